"""Odometry is read from nav_msgs/Odometry or TF, with its stamp and sender."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.common.odometry import OdometryReader
from vsnbench.ros.ros1.interface import Ros1Interface, ros1_interface

NAMES = ros1_interface(load_profile("turtlebot2"))
FRAMES = NAMES.model_copy(update={"odometry": "", "tf": OdometryFrames(odom_frame="odom", base_frame="base_link")})
HALF = math.sqrt(0.5)
"""Sine and cosine of half a turn of 90°."""


class Reader(OdometryReader[str]):
    """A reader of messages whose stamps are numbers."""

    def __init__(self, names: Ros1Interface) -> None:
        self.taken: list[Any] = []
        super().__init__(names, lambda *reading: self.taken.append(reading))

    def _seconds(self, stamp: float) -> float:
        return stamp


def left_turn() -> SimpleNamespace:
    return SimpleNamespace(x=0.0, y=0.0, z=HALF, w=HALF)


def link(parent: str, child: str, stamp_s: float, x_m: float, turn: SimpleNamespace) -> SimpleNamespace:
    transform = SimpleNamespace(translation=SimpleNamespace(x=x_m, y=0.0, z=0.0), rotation=turn)
    header = SimpleNamespace(frame_id=parent, stamp=stamp_s)
    return SimpleNamespace(header=header, child_frame_id=child, transform=transform)


def test_odometry_messages_are_planar_poses() -> None:
    reader = Reader(NAMES)
    pose = SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0), orientation=left_turn())
    message = SimpleNamespace(header=SimpleNamespace(stamp=5.0), pose=SimpleNamespace(pose=pose))
    reader.take_odometry(message, "/base")
    ((position, stamp_s, sender),) = reader.taken
    assert position == pytest.approx((1.0, 2.0, math.pi / 2))
    assert (stamp_s, sender, reader.fault) == (5.0, "/base", "")


def test_links_of_tf_are_composed_and_a_missing_link_is_a_fault() -> None:
    reader = Reader(FRAMES)
    moving = SimpleNamespace(transforms=[link("odom", "base_footprint", 5.0, 1.0, left_turn())])
    reader.take_moving_links(moving, "/base")
    assert reader.taken == []
    assert reader.fault
    upright = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    reader.take_fixed_links(SimpleNamespace(transforms=[link("/base_footprint", "/base_link", 0.0, 0.5, upright)]))
    reader.take_moving_links(moving, "/base")
    ((position, stamp_s, sender),) = reader.taken
    assert position == pytest.approx((1.0, 0.5, math.pi / 2))
    assert (stamp_s, sender, reader.fault) == (5.0, "/base", "")
