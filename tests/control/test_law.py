"""The motion formulas against the paper's figures and a numerically integrated profile."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.control.law import (
    acceleration,
    braking_speed,
    ideal_duration_s,
    speed,
    straight_error_m,
    turn_error_rad,
)
from vsnbench.control.settings import MotionSettings
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base, RobotProfile, Speeds

SETTINGS = MotionSettings()
WAYS = [(0.25, False), (math.radians(30), True)]
"""Length of a motion, and whether it is a turn."""


def test_the_defaults_are_the_papers() -> None:
    assert (SETTINGS.linear_m_s, SETTINGS.angular_rad_s) == (0.3, 0.5)
    assert SETTINGS.acceleration_share == SETTINGS.deceleration_share == 1 / 3
    assert SETTINGS.position_tolerance_m == 0.005
    assert math.degrees(SETTINGS.heading_tolerance_rad) == pytest.approx(0.1)
    assert SETTINGS.forward_m == ProtocolParameters().forward_m
    assert math.degrees(SETTINGS.turn_rad) == pytest.approx(ProtocolParameters().turn_deg)


def test_settings_of_a_robot_stay_within_its_base() -> None:
    slow = RobotProfile(
        name="slow",
        title="A slow base with a slow odometer",
        base=Base(
            radius_m=0.3,
            height_m=1.1,
            mass_kg=18,
            track_m=0.5,
            wheel_radius_m=0.1,
            max_linear_m_s=0.2,
            max_angular_rad_s=1.0,
            odometry_rate_hz=10,
        ),
        speeds=Speeds(linear_m_s=2.0, angular_rad_s=0.5),
        camera=Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=1.0),
    )
    settings = MotionSettings.for_robot(slow, ProtocolParameters(forward_m=0.5, turn_deg=15))
    assert (settings.linear_m_s, settings.angular_rad_s) == (0.2, 0.5)
    assert settings.forward_m == 0.5
    assert settings.turn_rad == pytest.approx(math.radians(15))
    assert settings.settle_s >= 2 / slow.base.odometry_rate_hz


@given(st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_the_turn_error_goes_the_shorter_way_round(heading: float, left: float) -> None:
    assert turn_error_rad(heading + left, heading) == pytest.approx(left, abs=1e-9)
    assert turn_error_rad(heading + left + math.tau, heading) == pytest.approx(left, abs=1e-9)


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 3), st.floats(-3, 3))
def test_the_straight_error_does_not_depend_on_where_the_move_goes(x: float, y: float, gone: float, way: float) -> None:
    there = Pose(x + gone * math.cos(way), y + gone * math.sin(way))
    assert straight_error_m(0.25, Pose(x, y), there) == pytest.approx(0.25 - gone, abs=1e-9)


@pytest.mark.parametrize(("way", "turns"), WAYS)
def test_cruising_speed_is_reached_after_a_third_of_the_way(way: float, turns: bool) -> None:
    cruise = SETTINGS.cruise(turns=turns)
    ramp = acceleration(cruise, way, SETTINGS.acceleration_share)
    assert speed(0.0, ramp, way / 3) == pytest.approx(cruise)
    assert speed(cruise, -ramp, way / 3) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("way", "turns"), WAYS)
@pytest.mark.parametrize(("speeding_up", "braking"), [(1 / 3, 1 / 3), (0.1, 0.4), (0.5, 0.5)])
def test_the_ideal_duration_is_that_of_the_profile_integrated(
    way: float, turns: bool, speeding_up: float, braking: float
) -> None:
    settings = MotionSettings(acceleration_share=speeding_up, deceleration_share=braking)
    cruise = settings.cruise(turns=turns)
    slices = 20_000
    total = 0.0
    for k in range(slices):
        gone = (k + 0.5) / slices * way
        rising = speed(0.0, acceleration(cruise, way, speeding_up), gone)
        falling = speed(0.0, acceleration(cruise, way, braking), way - gone)
        total += way / slices / min(rising, falling, cruise)
    assert ideal_duration_s(way, settings, turns=turns) == pytest.approx(total, rel=5e-3)


def test_the_ideal_durations_of_the_papers_actions() -> None:
    assert ideal_duration_s(0.25, SETTINGS, turns=False) == pytest.approx(5 / 3 * 0.25 / 0.3)
    assert ideal_duration_s(math.radians(30), SETTINGS, turns=True) == pytest.approx(5 / 3 * math.radians(30) / 0.5)
    assert ideal_duration_s(0.0, SETTINGS, turns=False) == 0.0


@given(st.floats(0, 2), st.floats(0.05, 5), st.floats(0.005, 0.2))
def test_a_braking_speed_held_for_its_period_neither_overshoots_nor_brakes_harder(
    remaining: float, braking: float, period: float
) -> None:
    held = braking_speed(remaining, braking, period)
    left = remaining - held * period
    assert left >= -1e-9
    assert held <= speed(0.0, braking, max(left, 0.0)) + 1e-6
