"""Frames: composing and relating planar poses."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.values.pose import Pose, wrap_angle

coordinates = st.floats(-50, 50)
poses = st.builds(Pose, coordinates, coordinates, st.floats(-20, 20))


def test_forward_of_a_robot_that_looks_left_is_the_sites_y() -> None:
    moved = Pose.from_degrees(1, 2, 90).compose(Pose(0.25, 0))
    assert moved.position == pytest.approx((1, 2.25))


@given(origin=poses, local=poses)
def test_relative_to_undoes_compose(origin: Pose, local: Pose) -> None:
    back = origin.compose(local).relative_to(origin)
    assert back.position == pytest.approx(local.position, abs=1e-9)
    assert back.heading_rad == pytest.approx(local.heading_rad, abs=1e-9)


@given(st.floats(-1000, 1000))
def test_wrapped_angles_point_the_same_way(angle_rad: float) -> None:
    wrapped = wrap_angle(angle_rad)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_pose_of_no_number_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        Pose(bad, 0)
