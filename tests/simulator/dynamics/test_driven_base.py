"""Each property of a base that is not ideal shows in its motion or its odometry, and in nothing else."""

import math
import statistics
from pathlib import Path

import numpy as np
import pytest

from tests.sensing.stand import PROFILE, SCENE
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.robots.profiles import load_dynamics
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import BaseDynamics


def driven(command: Command, seconds: float, rest_s: float = 0.0, **dynamics: float) -> tuple[Pose, Pose, DrivenBase]:
    """Return the true pose, the odometry and the base after a velocity and a rest."""
    base = DrivenBase(SCENE, PROFILE.base, BaseDynamics(**dynamics))
    base.place(Pose(0.0, 0.0), np.random.default_rng(1))
    measured = Pose(0.0, 0.0)
    for number in range(round((seconds + rest_s) / CONTROL_PERIOD_S)):
        base.drive(command if number < round(seconds / CONTROL_PERIOD_S) else STANDSTILL)
        measured = base.measure()
    return base.physics.pose, measured, base


BASES = Path(__file__).parents[3] / "examples" / "bases"
AHEAD, TURN = Command(0.2, 0.0), Command(0.0, 0.5)
MOVING_M, MOVED_M = driven(AHEAD, 2.0)[0].x_m, driven(AHEAD, 2.0, 1.0)[0].x_m
"""Of an ideal base, after two seconds and at rest; its wheels slip by 4 mm when they start at once."""


@pytest.mark.parametrize("dead_time_s", [0.05, 0.1, 0.15])
def test_a_dead_time_delays_the_motion_and_loses_none_of_it(dead_time_s: float) -> None:
    behind_m = MOVING_M - driven(AHEAD, 2.0, dead_time_s=dead_time_s)[0].x_m
    assert behind_m == pytest.approx(0.2 * dead_time_s, abs=0.004)
    assert driven(AHEAD, 2.0, 1.0, dead_time_s=dead_time_s)[0].x_m == pytest.approx(MOVED_M, abs=0.001)


@pytest.mark.parametrize("lag_s", [0.02, 0.08, 0.2])
def test_a_motor_lag_delays_the_motion_exponentially_and_loses_none_of_it(lag_s: float) -> None:
    moved_m = driven(AHEAD, 2.0, motor_time_constant_s=lag_s)[0].x_m
    assert MOVED_M - moved_m == pytest.approx(0.2 * lag_s, abs=0.004)
    after_one_lag = driven(AHEAD, lag_s, motor_time_constant_s=lag_s)[0].x_m
    assert after_one_lag == pytest.approx(0.2 * lag_s * math.exp(-1), abs=0.004)
    assert driven(AHEAD, 2.0, 2.0, motor_time_constant_s=lag_s)[0].x_m == pytest.approx(MOVED_M, abs=0.001)


def test_a_command_within_the_deadband_moves_nothing() -> None:
    limits = {"deadband_m_s": 0.05, "deadband_rad_s": 0.1}
    assert driven(Command(0.049, 0.099), 2.0, **limits)[0].distance_to(Pose(0.0, 0.0)) < 1e-4
    assert driven(Command(0.05, 0.0), 2.0, **limits)[0].x_m == pytest.approx(0.1, abs=0.002)
    assert driven(Command(0.0, 0.1), 2.0, **limits)[0].heading_rad == pytest.approx(0.2, abs=0.005)


def test_wheels_that_skid_report_more_turn_than_the_base_makes() -> None:
    pose, measured, _ = driven(TURN, 2.0, turn_slip=0.1)
    assert pose.heading_rad == pytest.approx(0.9, abs=0.01)
    assert measured.heading_rad == pytest.approx(1.0, abs=0.01)


def test_a_turn_gain_is_real_and_measured() -> None:
    pose, measured, _ = driven(TURN, 2.0, turn_gain=1.4)
    assert pose.heading_rad == pytest.approx(1.4, abs=0.02)
    assert measured.heading_rad == pytest.approx(1.4, abs=0.02)


def test_drift_to_the_side_is_real_and_measured() -> None:
    pose, measured, _ = driven(AHEAD, 2.0, crab=0.02)
    assert pose.y_m == pytest.approx(0.008, abs=0.001)
    assert measured.y_m == pytest.approx(0.008, abs=0.001)


def test_a_gait_sways_while_the_base_walks_and_ends_where_it_began() -> None:
    sides = [driven(AHEAD, seconds, sway_m=0.01, sway_hz=2.0)[0].y_m for seconds in np.arange(1.0, 2.0, 0.1)]
    assert max(sides) > 0.007
    assert min(sides) < -0.007
    assert driven(AHEAD, 2.0, 2.0, sway_m=0.01, sway_hz=2.0)[0].y_m == pytest.approx(0.0, abs=0.002)
    assert driven(STANDSTILL, 1.0, sway_m=0.01)[0].y_m == 0.0


def test_only_a_base_that_can_moves_sideways_and_within_its_limit() -> None:
    left = Command(0.0, 0.0, 0.2)
    assert driven(left, 2.0)[0].y_m == 0.0
    pose, measured, _ = driven(left, 2.0, max_lateral_m_s=0.1)
    assert pose.y_m == pytest.approx(0.2, abs=0.002)
    assert measured.y_m == pytest.approx(pose.y_m, abs=0.002)


def test_encoders_count_whole_steps_without_a_growing_error() -> None:
    pose, measured, _ = driven(Command(0.2, 0.3), 4.0, encoder_step_m=0.001)
    exact = driven(Command(0.2, 0.3), 4.0)[1]
    assert measured.distance_to(exact) < 0.004
    assert measured != exact
    still = driven(STANDSTILL, 1.0, encoder_step_m=0.001)[1]
    assert still == Pose(0.0, 0.0)
    assert pose.distance_to(Pose(0.0, 0.0)) > 0.5


def test_readings_have_the_stated_noise_and_the_measurement_has_none() -> None:
    _, measured, base = driven(AHEAD, 0.5, position_noise_m=0.002, heading_noise_deg=0.05)
    readings = [base.read(measured) for _ in range(600)]
    assert statistics.stdev(reading.x_m for reading in readings) == pytest.approx(0.002, rel=0.15)
    headings_deg = [math.degrees(reading.heading_rad) for reading in readings]
    assert statistics.stdev(headings_deg) == pytest.approx(0.05, rel=0.15)
    assert base.measure() == measured


def test_a_gyro_drifts_at_rest_too() -> None:
    _, measured, base = driven(STANDSTILL, 10.0, heading_drift_deg_s=0.02)
    assert math.degrees(base.read(measured).heading_rad) == pytest.approx(0.2, abs=1e-6)


def test_a_ramp_of_the_driver_limits_each_wheel() -> None:
    limit = {"wheel_acceleration_m_s2": 0.12}
    assert driven(AHEAD, 1.0, **limit)[0].x_m == pytest.approx(0.06, abs=0.005)
    assert driven(AHEAD, 2.0, 2.0, **limit)[0].x_m == pytest.approx(0.4, abs=0.005)
    assert driven(TURN, 0.5, **limit)[0].heading_rad == pytest.approx(0.12 / PROFILE.base.track_m * 0.25, abs=0.02)


def test_slow_turns_can_be_real_and_not_measured() -> None:
    pose, measured, _ = driven(Command(0.0, 0.08), 2.0, unmeasured_rad_s=0.1)
    assert pose.heading_rad == pytest.approx(0.16, abs=0.01)
    assert measured.heading_rad == 0.0
    assert driven(TURN, 2.0, unmeasured_rad_s=0.1)[1].heading_rad == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("file", ["kobuki", "skid_steer", "legged", "create3"])
def test_the_bases_of_the_examples_can_be_simulated(file: str) -> None:
    dynamics = load_dynamics(BASES / f"{file}.yaml", PROFILE)
    assert dynamics.conditions
    assert driven(AHEAD, 1.0, **dynamics.conditions)[0].x_m == pytest.approx(0.2, abs=0.08)
