"""Dead reckoning from wheel angles against closed forms."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.simulator.dynamics.odometry import WheelOdometry
from vsnbench.simulator.dynamics.physics import WheelAngles
from vsnbench.values.pose import Pose

RADIUS_M, TRACK_M = 0.035, 0.23


@settings(deadline=None)
@given(st.floats(-2, 2), st.floats(-3, 3))
def test_many_small_arcs_add_up_to_the_large_one(way_m: float, turn_rad: float) -> None:
    odometry = WheelOdometry(RADIUS_M, TRACK_M)
    left_rad = (way_m - turn_rad * TRACK_M / 2) / RADIUS_M
    right_rad = (way_m + turn_rad * TRACK_M / 2) / RADIUS_M
    slices = 400
    for k in range(1, slices + 1):
        odometry.update(WheelAngles(left_rad * k / slices, right_rad * k / slices))
    chord_m = way_m if abs(turn_rad) < 1e-9 else way_m * math.sin(turn_rad / 2) / (turn_rad / 2)
    assert odometry.pose.heading_rad == pytest.approx(turn_rad, abs=1e-9)
    assert odometry.pose.x_m == pytest.approx(chord_m * math.cos(turn_rad / 2), abs=1e-4)
    assert odometry.pose.y_m == pytest.approx(chord_m * math.sin(turn_rad / 2), abs=1e-4)


def test_zeroing_forgets_the_way_but_not_what_the_encoders_read() -> None:
    odometry = WheelOdometry(RADIUS_M, TRACK_M)
    odometry.update(WheelAngles(10.0, 12.0))
    odometry.zero(WheelAngles(10.0, 12.0))
    assert odometry.pose == Pose(0.0, 0.0, 0.0)
    assert odometry.update(WheelAngles(11.0, 13.0)).x_m == pytest.approx(0.035)
