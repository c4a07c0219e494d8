"""The check-up of odometry at rest, hazard sensors, frames of images, and profiles."""

import math
import random
import struct

import pytest

from vsnbench.robots.checkup.base import ActiveHazards
from vsnbench.robots.checkup.checks import frame_id, frame_results
from vsnbench.robots.checkup.odometry import frames_result, odometry_results
from vsnbench.robots.checkup.profile import implausible_values
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.odometry.odometry import PlanarReading
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.robot_profile import Tolerances

PROFILE = load_profile("turtlebot2")


def at_rest(noise_deg: float = 0.0, **changes: float) -> list[PlanarReading]:
    rng = random.Random(2)
    readings = [
        PlanarReading(1.0, 2.0, math.remainder(math.pi + rng.gauss(0, math.radians(noise_deg)), math.tau), i / 50)
        for i in range(60)
    ]
    last = readings[-1]
    readings[-1] = PlanarReading(changes.get("x_m", last.x_m), last.y_m, last.heading_rad, last.stamp_s)
    return readings


@pytest.mark.parametrize(
    ("readings", "health"),
    [
        (at_rest(), "ok"),
        (at_rest(0.05), "ok"),
        (at_rest(0.5), "failed"),
        (at_rest(x_m=math.nan), "failed"),
        (at_rest(x_m=4.0), "failed"),
    ],
)
def test_unusable_odometry_fails(readings, health) -> None:
    (result,) = odometry_results(PROFILE, readings)
    assert result.health == health


def test_larger_tolerances_of_the_profile_allow_more_noise() -> None:
    coarse = PROFILE.model_copy(update={"tolerances": Tolerances(turn_deg=1.0)})
    (result,) = odometry_results(coarse, at_rest(0.5))
    assert result.health == "ok"


def test_an_active_hazard_sensor_fails_until_it_is_released() -> None:
    hazards = ActiveHazards()
    assert list(hazards.results()) == []
    hazards.take(Hazard.BUMPER, 1, True, "centre")
    (result,) = hazards.results()
    assert (result.health, result.seen) == ("failed", "the base reports: bumper (centre)")
    hazards.take(Hazard.BUMPER, 1, False, "centre")
    assert list(hazards.results()) == []


def message(frame: str, ending: bytes = b"") -> bytes:
    name = frame.encode() + ending
    return bytes(12) + struct.pack("<I", len(name)) + name + bytes(40)


@pytest.mark.parametrize("ending", [b"", b"\0"])
def test_depth_in_another_frame_than_colour_is_a_warning(ending: bytes) -> None:
    names = interface_of(PROFILE)
    color = TopicMessages(messages=[message("camera_rgb_optical_frame", ending)])
    for depth, warned in (("camera_depth_optical_frame", True), ("camera_rgb_optical_frame", False), ("", False)):
        messages = {names.color: color, names.depth: TopicMessages(messages=[message(depth, ending)])}
        results = list(frame_results(names, messages))
        assert [result.health for result in results] == (["warning"] if warned else [])
    assert frame_id(message("/base", ending)) == "base"
    assert frame_id(b"short") == ""


def test_unaligned_depth_of_a_realsense_is_implausible() -> None:
    stretch = load_profile("stretch")
    unaligned = stretch.model_copy(
        update={"interface": stretch.interface.model_copy(update={"depth": "/camera/depth/image_rect_raw"})}
    )
    assert not any("aligned" in doubt for doubt in implausible_values(stretch))
    assert any("align_depth" in doubt for doubt in implausible_values(unaligned))


@pytest.mark.parametrize(
    ("fault", "senders", "health"),
    [
        ("", {"/base"}, "ok"),
        ("TF does not connect odom to base_link", set(), "failed"),
        ("", {"/base", "/filter"}, "failed"),
    ],
)
def test_frames_give_odometry_when_they_connect_and_one_node_moves_them(fault, senders, health) -> None:
    assert frames_result(OdometryFrames(), fault, senders).health == health
