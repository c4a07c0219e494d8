"""A discrete motion on exact, late, sluggish, swerving and broken bases."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.control.bases import BACKWARD, FORWARD, LEFT, RIGHT, BaseModel, Motion, move
from vsnbench.control.command import STANDSTILL, MotionStatus
from vsnbench.control.controller import MotionController
from vsnbench.control.law import ideal_duration_s
from vsnbench.control.leg import Leg
from vsnbench.control.response import BaseResponse
from vsnbench.control.settings import MotionSettings
from vsnbench.values.pose import Pose

PAPER = MotionSettings()
SLOW_ODOMETER = MotionSettings(settle_s=0.25)
MOTIONS = [FORWARD, BACKWARD, LEFT, RIGHT]
LATE_BASES = {
    "the command acts 0.1 s later": (BaseModel(command_delay_s=0.1), PAPER),
    "the speed follows with a time constant of 0.1 s": (BaseModel(sluggishness_s=0.1), PAPER),
    "odometry is 0.1 s old and says so": (BaseModel(odometry_delay_s=0.1), PAPER),
    "odometry is 0.1 s old and does not say so": (BaseModel(odometry_delay_s=0.1, stamped=False), PAPER),
    "odometry comes at 10 Hz": (BaseModel(odometry_period_s=0.1), SLOW_ODOMETER),
    "odometry comes at 10 Hz and 0.1 s late": (
        BaseModel(odometry_period_s=0.1, odometry_delay_s=0.1, stamped=False),
        SLOW_ODOMETER,
    ),
    "everything is 0.1 s late at 10 Hz": (
        BaseModel(odometry_period_s=0.1, odometry_delay_s=0.1, command_delay_s=0.1, sluggishness_s=0.1, stamped=False),
        SLOW_ODOMETER,
    ),
    "the wheels turn a tenth too slowly": (BaseModel(gain=0.9), PAPER),
    "the wheels turn a tenth too fast and 0.1 s late": (BaseModel(gain=1.1, command_delay_s=0.1), PAPER),
    "the gyroscope resolves 0.01 degrees": (BaseModel(quantum_rad=math.radians(0.01)), PAPER),
}


def true_error(motion: Motion, leg: Leg, asked: MotionSettings = PAPER) -> float:
    """Return the true final error in units of the tolerance, long after the motion ended."""
    covered = abs(motion.turn_rad) if leg.turns else motion.displacement_m
    return abs(covered - abs(leg.way)) / asked.tolerance(turns=leg.turns)


@pytest.mark.parametrize("leg", MOTIONS)
def test_an_exact_base_does_what_is_asked_at_once(leg: Leg) -> None:
    motion = move(leg, BaseModel(), PAPER)
    assert motion.controller.done
    assert motion.controller.corrections == 0
    assert true_error(motion, leg) < 0.1
    ideal_s = ideal_duration_s(abs(leg.way), PAPER, turns=leg.turns)
    assert ideal_s <= motion.controller.duration_s < 1.1 * ideal_s


def test_each_action_moves_to_its_own_side() -> None:
    ends = {leg: move(leg, BaseModel(), PAPER, Pose(1.0, 2.0, math.pi / 2)).end for leg in MOTIONS}
    assert ends[FORWARD].y_m == pytest.approx(2.25, abs=1e-3)
    assert ends[BACKWARD].y_m == pytest.approx(1.75, abs=1e-3)
    assert ends[LEFT].heading_rad == pytest.approx(math.radians(120), abs=1e-3)
    assert ends[RIGHT].heading_rad == pytest.approx(math.radians(60), abs=1e-3)


@pytest.mark.parametrize("leg", MOTIONS)
@pytest.mark.parametrize("base", LATE_BASES)
def test_a_late_or_inexact_base_still_ends_within_the_tolerance(base: str, leg: Leg) -> None:
    model, asked = LATE_BASES[base]
    motion = move(leg, model, asked)
    assert motion.controller.done, motion.controller.failure
    assert motion.controller.corrections <= 2
    assert true_error(motion, leg) < 1


def test_noisy_odometry_of_a_base_that_still_rolls_is_not_taken_for_its_end() -> None:
    rolls = BaseModel(command_delay_s=0.1, sluggishness_s=0.2, noise_rad=math.radians(0.05))
    known = BaseResponse(dead_time_s=0.105, lag_s=0.2, slowest_rad_s=0.19)
    motions = [move(LEFT, rolls, PAPER, response=known, seed=seed) for seed in range(12)]
    assert [motion.controller.failure for motion in motions] == [""] * len(motions)
    assert max(true_error(motion, LEFT) for motion in motions) < 1


@pytest.mark.parametrize("leg", MOTIONS)
def test_a_motion_is_only_done_when_the_base_stands_still(leg: Leg) -> None:
    motion = move(leg, BaseModel(sluggishness_s=0.1), PAPER)
    ended = next(sample for sample in motion.samples if sample.at_s >= motion.controller.duration_s)
    rest = ended.pose.distance_to(motion.end) + abs(ended.pose.heading_rad - motion.end.heading_rad)
    assert rest < 5e-4
    assert motion.samples[-1].command == STANDSTILL


def test_turning_to_absolute_targets_does_not_drift() -> None:
    pose = Pose(0.0, 0.0, 0.0)
    for turn in range(1, 37):
        pose = move(LEFT, BaseModel(command_delay_s=0.06), PAPER, pose, target_heading_rad=turn * LEFT.way).end
        assert abs(pose.heading_rad - turn * LEFT.way) < PAPER.heading_tolerance_rad


def test_a_turn_makes_up_for_what_the_heading_was_off_before_it() -> None:
    crooked = Pose(0.0, 0.0, math.radians(2.0))
    motion = move(RIGHT, BaseModel(), PAPER, crooked, target_heading_rad=math.radians(-30))
    assert motion.end.heading_deg == pytest.approx(-30, abs=0.1)


@pytest.mark.parametrize("start_deg", [0.0, 0.3, -0.3])
def test_half_a_turn_goes_round_the_side_it_was_asked_to(start_deg: float) -> None:
    half = math.pi
    start = Pose.from_degrees(0, 0, start_deg)
    left = move(Leg(half, turns=True), BaseModel(), PAPER, start, target_heading_rad=half)
    right = move(Leg(-half, turns=True), BaseModel(), PAPER, start, target_heading_rad=-half)
    assert left.end.heading_deg == pytest.approx(180, abs=0.1)
    assert right.end.heading_deg == pytest.approx(-180, abs=0.1)


def test_a_move_holds_its_heading_on_a_swerving_base() -> None:
    swerving = BaseModel(swerve_rad_per_m=0.1, command_delay_s=0.05)
    held = move(FORWARD, swerving, PAPER)
    loose = move(FORWARD, swerving, PAPER.model_copy(update={"heading_gain_per_s": 0.0}))
    assert math.degrees(loose.turn_rad) == pytest.approx(math.degrees(0.1 * 0.25), abs=0.05)
    assert abs(held.turn_rad) < loose.turn_rad / 3


@pytest.mark.parametrize("leg", MOTIONS)
def test_a_stuck_base_is_noticed_long_before_the_time_out(leg: Leg) -> None:
    motion = move(leg, BaseModel(gain=0.0), PAPER)
    assert motion.controller.status is MotionStatus.FAILED
    assert "does not follow" in motion.controller.failure
    assert motion.controller.duration_s < 2
    assert motion.samples[-1].command == STANDSTILL


def test_repeated_overshoot_fails_with_a_reason() -> None:
    fine = PAPER.model_copy(update={"heading_tolerance_rad": 1e-5, "max_corrections": 2})
    coarse = BaseModel(quantum_rad=math.radians(0.7))
    motion = move(LEFT, coarse, fine)
    assert motion.controller.status is MotionStatus.FAILED
    assert motion.controller.corrections == 2
    assert "off after 2 corrections" in motion.controller.failure


def test_lost_odometry_ends_the_motion_and_says_so() -> None:
    controller = MotionController(FORWARD, Pose(0, 0), 0.0, PAPER)
    now_s = 0.0
    while controller.status is MotionStatus.MOVING:
        controller.step(Pose(0, 0), now_s, stamp_s=0.0)
        now_s += 0.02
        assert now_s < 5
    assert controller.sensor_lost
    assert "no odometry" in controller.failure
    assert controller.step(Pose(0, 0), now_s) == STANDSTILL


@pytest.mark.parametrize("silent_from_s", [0.1, 0.3, 0.5])
def test_early_silence_of_the_odometry_is_not_a_stuck_base(silent_from_s: float) -> None:
    controller = MotionController(FORWARD, Pose(0, 0), 0.0, PAPER)
    now_s, x_m, seen = 0.0, 0.0, (Pose(0, 0), 0.0)
    while controller.status is MotionStatus.MOVING:
        if now_s <= silent_from_s:
            seen = Pose(x_m, 0), now_s
        command = controller.step(seen[0], now_s, stamp_s=seen[1])
        x_m += command.linear_m_s * 0.02
        now_s += 0.02
    assert controller.sensor_lost
    assert "no odometry" in controller.failure


def test_an_aborted_motion_stands_still_and_keeps_its_reason() -> None:
    controller = MotionController(FORWARD, Pose(0, 0), 0.0, PAPER)
    controller.step(Pose(0, 0), 0.0)
    assert controller.abort("bumper") == STANDSTILL
    assert controller.abort("later") == STANDSTILL
    assert (controller.status, controller.failure) == (MotionStatus.FAILED, "bumper")


any_base = st.builds(
    BaseModel,
    command_delay_s=st.sampled_from([0.0, 0.02, 0.05, 0.1, 0.2]),
    sluggishness_s=st.floats(0, 0.15),
    odometry_delay_s=st.sampled_from([0.0, 0.02, 0.1]),
    odometry_period_s=st.sampled_from([0.02, 0.05, 0.1]),
    stamped=st.booleans(),
    gain=st.floats(-0.1, 1.2),
    swerve_rad_per_m=st.floats(-0.2, 0.2),
)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(MOTIONS), any_base, st.floats(-3, 3))
def test_whatever_the_base_does_speeds_stay_in_their_limits_and_the_motion_ends(
    leg: Leg, base: BaseModel, heading: float
) -> None:
    motion = move(leg, base, SLOW_ODOMETER, Pose(0, 0, heading))
    controller = motion.controller
    assert controller.status is not MotionStatus.MOVING
    assert controller.duration_s <= ideal_duration_s(abs(leg.way), PAPER, turns=leg.turns) + PAPER.timeout_s + 0.1
    assert controller.corrections <= PAPER.max_corrections
    for sample in motion.samples:
        assert abs(sample.command.linear_m_s) <= PAPER.linear_m_s + 1e-9
        assert abs(sample.command.angular_rad_s) <= PAPER.angular_rad_s + 1e-9
    if controller.done:
        assert true_error(motion, leg) < 1
    else:
        assert controller.failure


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from(MOTIONS),
    st.floats(0.2, 4.0),
    st.floats(0.1, 0.5),
    st.floats(0.1, 0.5),
)
def test_an_exact_base_never_turns_back_and_speeds_up_before_it_slows_down(
    leg: Leg, longer: float, speeding_up: float, braking: float
) -> None:
    leg = Leg(longer * leg.way, turns=leg.turns)
    asked = MotionSettings(acceleration_share=speeding_up, deceleration_share=braking)
    motion = move(leg, BaseModel(), asked)
    assert motion.controller.done
    assert motion.controller.corrections == 0
    assert true_error(motion, leg, asked) < 1
    side = 1 if leg.way > 0 else -1
    along = [side * (s.command.angular_rad_s if leg.turns else s.command.linear_m_s) for s in motion.samples]
    peak = along.index(max(along))
    assert min(along) >= 0
    assert all(later >= earlier - 1e-9 for earlier, later in pairwise(along[: peak + 1]))
    assert all(later <= earlier + 1e-9 for earlier, later in pairwise(along[peak:]))
