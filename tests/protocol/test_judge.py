"""All rules of the protocol about the end and the success of an episode."""

import pytest

from vsnbench.protocol.judge import EndReason, GoalDistance, end_after, judge
from vsnbench.protocol.limits import Spent, budget_left
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.fix import PoseSource
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.observation import Budget

PAPER = ProtocolParameters()
DONE = MotionResult(completed=True)
HIT = MotionResult(completed=False, collision=Collision(CollisionSource.BUMPER, "sofa-1"))
STUCK = MotionResult(completed=False, failure="stalled")
BLIND = MotionResult(completed=False, failure="odometry silent", sensor_lost=True)
BLOCKED = None


def metres(distance_m: float, source: PoseSource = PoseSource.SIMULATED) -> GoalDistance:
    return GoalDistance(distance_m, source, "chair-1")


@pytest.mark.parametrize(
    ("actions", "action", "result", "expected"),
    [
        (1, Action.MOVE_FORWARD, DONE, None),
        (1, Action.MOVE_FORWARD, BLOCKED, None),
        (149, Action.TURN_LEFT, DONE, None),
        (1, Action.STOP, DONE, EndReason.STOP),
        (149, Action.STOP, DONE, EndReason.STOP),
        (150, Action.STOP, DONE, EndReason.STEP_LIMIT),
        (150, Action.MOVE_FORWARD, DONE, EndReason.STEP_LIMIT),
        (150, Action.MOVE_FORWARD, BLOCKED, EndReason.STEP_LIMIT),
        (7, Action.MOVE_FORWARD, HIT, EndReason.COLLISION),
        (7, Action.STOP, HIT, EndReason.COLLISION),
        (150, Action.MOVE_FORWARD, HIT, EndReason.COLLISION),
        (7, Action.TURN_RIGHT, STUCK, EndReason.MOTION_FAILED),
        (7, Action.TURN_RIGHT, BLIND, EndReason.SENSOR_LOST),
    ],
)
def test_an_episode_ends_for_exactly_one_reason(
    actions: int, action: Action, result: MotionResult | None, expected: EndReason | None
) -> None:
    assert end_after(Spent(actions), action, result, PAPER) is expected


@pytest.mark.parametrize(
    ("reason", "actions", "distance_m", "success"),
    [
        (EndReason.STOP, 1, 0.0, True),
        (EndReason.STOP, 149, 0.999, True),
        (EndReason.STOP, 149, 1.000, False),
        (EndReason.STOP, 20, 1.001, False),
        (EndReason.STOP, 150, 0.1, False),
        (EndReason.STEP_LIMIT, 150, 0.1, False),
        (EndReason.COLLISION, 12, 0.1, False),
        (EndReason.MOTION_FAILED, 12, 0.1, None),
        (EndReason.SENSOR_LOST, 12, 0.1, None),
        (EndReason.MODEL_ERROR, 12, 0.1, None),
        (EndReason.ABORTED, 12, 0.1, None),
        (EndReason.INTERRUPTED, 12, 0.1, None),
    ],
)
def test_success_is_stop_in_time_and_near_and_untouched(
    reason: EndReason, actions: int, distance_m: float, success: bool | None
) -> None:
    assert judge(reason, actions, metres(distance_m), PAPER).success is success


def test_only_stop_collision_and_limits_are_results() -> None:
    limits = {EndReason.STEP_LIMIT, EndReason.TIME_LIMIT, EndReason.PATH_LIMIT}
    assert {reason for reason in EndReason if reason.is_result} == {EndReason.STOP, EndReason.COLLISION, *limits}


LIMITED = ProtocolParameters(max_actions=20, max_time_s=60, max_path_m=5)


@pytest.mark.parametrize(
    ("spent", "action", "result", "expected"),
    [
        (Spent(3, driving_s=59.9), Action.STOP, DONE, EndReason.STOP),
        (Spent(3, driving_s=59.9), Action.TURN_LEFT, DONE, None),
        (Spent(3, driving_s=40, thinking_s=20), Action.TURN_LEFT, DONE, EndReason.TIME_LIMIT),
        (Spent(3, driving_s=60), Action.STOP, DONE, EndReason.TIME_LIMIT),
        (Spent(3, path_m=4.99), Action.MOVE_FORWARD, DONE, None),
        (Spent(3, path_m=5.0), Action.MOVE_FORWARD, DONE, EndReason.PATH_LIMIT),
        (Spent(3, driving_s=60, path_m=5.0), Action.MOVE_FORWARD, DONE, EndReason.TIME_LIMIT),
        (Spent(20, driving_s=60, path_m=5.0), Action.MOVE_FORWARD, DONE, EndReason.STEP_LIMIT),
        (Spent(3, driving_s=60), Action.MOVE_FORWARD, HIT, EndReason.COLLISION),
        (Spent(3, driving_s=60), Action.MOVE_FORWARD, STUCK, EndReason.MOTION_FAILED),
    ],
)
def test_the_first_limit_that_is_reached_ends_the_episode(
    spent: Spent, action: Action, result: MotionResult, expected: EndReason | None
) -> None:
    assert end_after(spent, action, result, LIMITED) is expected


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        (EndReason.TIME_LIMIT, "failed: time limit of 60 s reached at action 9"),
        (EndReason.PATH_LIMIT, "failed: path limit of 5 m reached at action 9"),
    ],
)
def test_a_limit_fails_however_near_the_goal_is(reason: EndReason, text: str) -> None:
    verdict = judge(reason, 9, metres(0.1), LIMITED)
    assert (verdict.end_reason, verdict.success, verdict.text) == (reason, False, text)


def test_the_budget_is_what_the_limits_leave() -> None:
    spent = Spent().after(driving_s=1.5, thinking_s=0.5, path_m=0.25)
    assert budget_left(spent, LIMITED) == Budget(19, 58.0, 4.75)
    assert budget_left(spent, PAPER) == Budget(149)
    assert budget_left(Spent(3, driving_s=61, path_m=9), LIMITED) == Budget(17, 0.0, 0.0)


def test_a_stop_as_the_last_action_of_the_cap_is_judged_a_step_limit() -> None:
    assert judge(EndReason.STOP, 150, metres(0.1), PAPER).end_reason is EndReason.STEP_LIMIT


def test_a_stop_without_a_distance_cannot_be_judged() -> None:
    with pytest.raises(ValueError, match="distance"):
        judge(EndReason.STOP, 10, None, PAPER)


def test_another_cap_and_another_radius_are_obeyed() -> None:
    parameters = ProtocolParameters(max_actions=10, success_distance_m=0.5)
    assert end_after(Spent(10), Action.TURN_LEFT, DONE, parameters) is EndReason.STEP_LIMIT
    assert judge(EndReason.STOP, 9, metres(0.6), parameters).success is False


def test_the_verdict_says_how_the_distance_was_measured() -> None:
    text = judge(EndReason.STOP, 36, metres(0.52, PoseSource.TAPE), PAPER).text
    assert "success" in text
    assert "0.520 m from chair-1 (tape)" in text


def test_a_stop_near_a_goal_that_a_wall_hides_fails_and_says_so() -> None:
    verdict = judge(EndReason.STOP, 12, GoalDistance(0.4, PoseSource.SIMULATED, "chair-1", in_sight=False), PAPER)
    assert verdict.success is False
    assert "0.400 m from chair-1 (simulated), behind a wall" in verdict.text


@pytest.mark.parametrize("reason", EndReason)
def test_every_reason_for_an_end_has_a_verdict(reason: EndReason) -> None:
    verdict = judge(reason, 5, GoalDistance(3.0, PoseSource.SIMULATED), ProtocolParameters())
    assert (verdict.success is None) == (not reason.is_result)
    assert verdict.text.startswith("failed: " if reason.is_result else "void: ")
