"""The heading of odometry never wraps, and invalid readings are reported."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.sensing.odometry.odometry import (
    ClockOffset,
    OdometryFault,
    OdometryReading,
    OdometryTracker,
    heading_of_quaternion,
    pose_at,
)
from vsnbench.values.pose import Pose, wrap_angle


def tracker() -> OdometryTracker:
    return OdometryTracker(max_linear_m_s=0.7, max_angular_rad_s=math.pi)


@settings(deadline=None)
@given(st.floats(-math.pi + 1e-6, math.pi))
def test_a_heading_survives_its_quaternion(heading: float) -> None:
    assert heading_of_quaternion(0, 0, math.sin(heading / 2), math.cos(heading / 2)) == pytest.approx(heading, abs=1e-9)


@pytest.mark.parametrize("broken", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (0, 0, math.inf, 1)])
def test_an_invalid_quaternion_has_no_heading(broken) -> None:
    assert math.isnan(heading_of_quaternion(*broken))


@settings(deadline=None)
@given(st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=80))
def test_turning_adds_up_beyond_half_turns(turns: list[float]) -> None:
    odometry = tracker()
    odometry.add(0, 0, 0, 0, 0)
    total = 0.0
    for index, turn in enumerate(turns, 1):
        total += turn
        assert odometry.add(0, 0, wrap_angle(total), index, index) is None
    assert odometry.latest is not None
    assert odometry.latest.pose.heading_rad == pytest.approx(total, abs=1e-9)


def test_a_base_that_teleports_is_reported_and_followed() -> None:
    odometry = tracker()
    odometry.add(0, 0, 0, 0.00, 0.00)
    fault = odometry.add(1.2, 0, 0, 0.02, 0.02)
    assert fault == OdometryFault("odometry jumped 1.20 m in 0.02 s")
    assert odometry.add(1.2, 0, 0, 0.04, 0.04) is None
    turned = odometry.add(1.2, 0, math.pi / 2, 0.06, 0.06)
    assert turned is not None
    assert turned.text == "odometry jumped 90° in 0.02 s"


def test_a_fast_base_and_a_late_message_are_not_jumps() -> None:
    odometry = tracker()
    odometry.add(0, 0, 0, 0.0, 0.0)
    assert odometry.add(0.014, 0, 0, 0.02, 0.02) is None
    assert odometry.add(0.7, 0, 0, 1.0, 1.0) is None
    assert odometry.add(0.9, 0, 0, 1.0, 1.3) is None  # the stamp is unchanged while the clock advances


@pytest.mark.parametrize("broken", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_a_reading_that_is_not_finite_is_reported_and_dropped(broken) -> None:
    odometry = tracker()
    odometry.add(0.1, 0.2, 0.3, 0, 0)
    fault = odometry.add(*broken, 0.02, 0.02)
    assert fault is not None
    assert fault.is_dropped
    assert odometry.latest is not None
    assert odometry.latest.pose == Pose(0.1, 0.2, 0.3)


@settings(deadline=None)
@given(st.floats(-100, 100), st.lists(st.floats(0, 0.5), min_size=1, max_size=50))
def test_a_skewed_clock_is_read_through_the_fastest_message(skew_s: float, delays: list[float]) -> None:
    clock = ClockOffset()
    for index, delay in enumerate(delays):
        clock.add(index + skew_s, index + delay)
    assert clock.to_local(7 + skew_s) == pytest.approx(7 + min(delays), abs=1e-9)


def test_the_pose_at_an_image_is_interpolated_between_two_readings() -> None:
    readings = [OdometryReading(Pose(0.1 * k, 0.0, 3.0 + 0.2 * k), 10 + 0.1 * k, 0.0) for k in range(4)]
    between = pose_at(readings, 10.15)
    assert between is not None
    assert (between.x_m, between.heading_rad) == pytest.approx((0.15, 3.3))
    assert pose_at(readings, 10.0) == readings[0].pose
    assert pose_at(readings, 11.0) == readings[-1].pose, "it is not extrapolated"
    assert pose_at(readings, 9.9) is None
    assert pose_at([], 10.0) is None
