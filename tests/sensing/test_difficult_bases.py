"""Movements on bases that are late, sluggish, noisy, deaf to slow commands or drift: True only when true.

Every movement is judged by the base's own true poses, in virtual time. `benchmarks/difficult_bases.py` measures the
whole grid.
"""

import math
from functools import cache
from itertools import pairwise
from statistics import mean

import pytest

from tests.sensing.stand import KINDS, LEGGED, PROFILE, SETTINGS, Stand, Trial, held, movements, stand_for, trial
from vsnbench.control.command import Command
from vsnbench.control.law import turn_error_rad
from vsnbench.control.settings import MotionSettings
from vsnbench.values.movement import Sidestep, Velocity
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics

COUNT = 4
LATE = BaseDynamics(dead_time_s=0.05, motor_time_constant_s=0.08)
BASES = {
    "late": (LATE, 1.5),
    "very late": (BaseDynamics(dead_time_s=0.1, motor_time_constant_s=0.2), 2.3),
    "slow odometry": (LATE.model_copy(update={"odometry_rate_hz": 10.0}), 2.0),
    "noisy": (LATE.model_copy(update={"position_noise_m": 0.002, "heading_noise_deg": 0.05}), 1.7),
    "exact wheels and a noisy gyro": (BaseDynamics(heading_noise_deg=0.04), 1.5),
    "drifts to the side": (LATE.model_copy(update={"crab": 0.02}), 1.5),
    "deaf to slow commands": (LATE.model_copy(update={"deadband_m_s": 0.05, "deadband_rad_s": 0.1}), 1.7),
    "turns more than commanded": (BaseDynamics(dead_time_s=0.1, turn_gain=1.5), 2.6),
    "turns less than commanded": (LATE.model_copy(update={"turn_gain": 0.5}), 2.8),
    "slow and askew to the side": (
        LATE.model_copy(update={"lateral_gain": 0.8, "creep": 0.06, "deadband_lateral_m_s": 0.06}),
        2.8,
    ),
    "walks": (LATE.model_copy(update={"sway_m": 0.008, "sway_hz": 2.5, "crab": 0.01}), 1.6),
}


class Recording(Stand):
    """A stand that keeps what was commanded."""

    def __post_init__(self) -> None:
        self.commands: list[Command] = []
        super().__post_init__()

    def hear(self, command: Command) -> None:
        self.commands.append(command)
        super().hear(command)


@cache
def ideal_trials(kind: str) -> list[Trial]:
    stand = stand_for(kind)
    return [trial(stand, kind, movement) for movement in movements(kind, COUNT, seed=1)]


ON_BASES = [
    pytest.param(base, kind, marks=() if (place - number) % len(KINDS) in (0, 3) else pytest.mark.long)
    for number, base in enumerate(BASES)
    for place, kind in enumerate(KINDS)
]
"""Every base with two kinds of movements and every kind on three bases or more; the other pairs are long tests."""


@pytest.mark.parametrize(("base", "kind"), ON_BASES)
def test_a_movement_on_a_difficult_base_is_done_facing_ahead_and_in_time(base: str, kind: str) -> None:
    dynamics, slower = BASES[base]
    stand = stand_for(kind, dynamics)
    tried = [trial(stand, kind, movement) for movement in movements(kind, COUNT, seed=1)]
    assert [one.result.failure for one in tried] == [""] * COUNT
    assert [one.off_m for one in tried if not one.is_true(kind)] == []
    took = mean(one.took_s / ideal.took_s for one, ideal in zip(tried, ideal_trials(kind), strict=True))
    assert took < slower


@pytest.mark.parametrize("kind", ["waypoint", "trajectory", "S-curve"])
def test_a_movement_ends_at_its_deadline(kind: str) -> None:
    stand = Stand(LATE)
    before_s = stand.base.now_s
    result = stand.mover.drive(movements(kind, 1, seed=1)[0], lambda: False, timeout_s=2.0)
    assert not result.completed
    assert "not done after" in result.failure
    assert stand.base.now_s - before_s == pytest.approx(2.0, abs=0.05)
    stand.sleep_until(stand.base.now_s + 1.0)
    assert stand.base.command.linear_m_s == 0.0


MINIMUMS = {"min_linear_m_s": 0.08, "min_angular_rad_s": 0.2, "min_lateral_m_s": 0.06}


@pytest.mark.parametrize("kind", KINDS)
def test_a_base_is_never_commanded_slower_than_its_minimum_and_ends_where_it_should(kind: str) -> None:
    base = LEGGED.base.model_copy(update=MINIMUMS)
    dynamics = LATE.model_copy(update={"deadband_m_s": 0.08, "deadband_rad_s": 0.2, "deadband_lateral_m_s": 0.06})
    stand = Recording(dynamics, profile=LEGGED.model_copy(update={"base": base}))
    tried = [trial(stand, kind, movement) for movement in movements(kind, COUNT, seed=2)]
    assert [one.result.failure for one in tried] == [""] * COUNT
    assert [one.off_m for one in tried if not one.is_true(kind)] == []
    for axis, least in MINIMUMS.items():
        sent = {abs(getattr(command, axis.removeprefix("min_"))) for command in stand.commands}
        assert min(sent - {0.0}, default=least) >= least - 1e-9, axis


def test_a_velocity_below_the_minimum_of_an_axis_is_zero_on_it() -> None:
    stand = Recording(LATE, profile=LEGGED.model_copy(update={"base": LEGGED.base.model_copy(update=MINIMUMS)}))
    result = stand.drive(Velocity(0.2, 0.1, 1.0))
    assert result.completed, result.failure
    assert {command.angular_rad_s for command in stand.commands} == {0.0}
    assert min(command.linear_m_s for command in stand.commands if command.linear_m_s) >= 0.08


def test_a_limit_of_the_acceleration_makes_movements_slower() -> None:
    base = PROFILE.base.model_copy(update={"max_acceleration_m_s2": 0.2, "max_acceleration_rad_s2": 0.4})
    settings = MotionSettings.for_robot(PROFILE.model_copy(update={"base": base}))
    stand = Recording(profile=PROFILE.model_copy(update={"base": base}))
    assert stand.drive(held(0.25)).completed
    speeds = [command.linear_m_s for command in stand.commands]
    steepest = max(abs(b - a) for a, b in pairwise(speeds[: len(speeds) // 2])) / settings.control_period_s
    assert steepest <= 0.2 * 1.02
    assert MotionSettings.for_robot(PROFILE).linear_m_s == 0.3, "without a limit the speed is the profile's"


def test_a_base_on_two_wheels_refuses_a_sidestep_without_moving() -> None:
    stand = Stand()
    before = stand.base.pose
    result = stand.drive(Sidestep(0.25))
    assert not result.completed
    assert "max_lateral_m_s" in result.failure
    assert stand.base.pose.distance_to(before) < 1e-6


@pytest.mark.parametrize("dynamics", [IDEAL_BASE, LATE.model_copy(update={"creep": 0.02, "crab": 0.02})])
def test_a_velocity_to_the_side_goes_where_it_says(dynamics: BaseDynamics) -> None:
    stand = Recording(dynamics, profile=LEGGED)
    before = stand.base.pose
    result = stand.drive(Velocity(0.2, 0.0, 2.0, -0.1))
    assert result.completed, result.failure
    moved = stand.base.pose.relative_to(before)
    assert moved.y_m / moved.x_m == pytest.approx(-0.5, abs=0.04)
    assert 0.25 < moved.x_m <= 0.4
    assert max(abs(command.lateral_m_s) for command in stand.commands) == pytest.approx(0.1)


def test_a_base_on_two_wheels_refuses_a_velocity_to_the_side_without_moving() -> None:
    stand = Recording()
    result = stand.drive(Velocity(0.2, 0.0, 1.0, 0.1))
    assert (result.completed, "max_lateral_m_s" in result.failure) == (False, True)
    assert {command.linear_m_s for command in stand.commands} <= {0.0}


def test_a_short_velocity_keeps_the_acceleration_of_a_base_that_states_one() -> None:
    base = PROFILE.base.model_copy(update={"max_acceleration_m_s2": 0.1})
    for profile, fastest_m_s in ((PROFILE.model_copy(update={"base": base}), 0.1 * 0.75), (PROFILE, 0.2)):
        stand = Recording(profile=profile)
        assert stand.drive(Velocity(0.2, 0.0, 1.5)).completed
        assert max(command.linear_m_s for command in stand.commands) == pytest.approx(fastest_m_s, abs=0.005)


def test_a_velocity_ends_at_rest_on_a_noisy_base() -> None:
    stand = Stand(BASES["noisy"][0])
    result = stand.drive(Velocity(0.2, 0.3, 1.5))
    assert result.completed, result.failure
    assert result.duration_s < 3.5


def test_turns_are_relative_to_the_heading_before_the_first_move_of_a_noisy_gyro() -> None:
    stand = Stand(LATE.model_copy(update={"encoder_step_m": 0.0000855, "heading_noise_deg": 0.03}))
    heading_rad = stand.base.pose.heading_rad
    for turn_deg in (0, 30, 0, 0, -30, 30):
        result = stand.drive(held(turn_deg=turn_deg) if turn_deg else held(0.25))
        assert result.completed, result.failure
        heading_rad += math.radians(turn_deg)
        if turn_deg:
            assert abs(turn_error_rad(stand.base.pose.heading_rad, heading_rad)) < SETTINGS.heading_tolerance_rad
