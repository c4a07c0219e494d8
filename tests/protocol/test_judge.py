"""Every ruling of the protocol about how an episode ends and whether it succeeds."""

import pytest

from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, end_after, judge
from vsnbench.protocol.metrics import distance_to_goal
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Room, Site, SiteObject, StartingPosition, Wall

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
    assert end_after(actions, action, result, PAPER) is expected


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


def test_only_stop_step_limit_and_collision_are_results() -> None:
    assert {reason for reason in EndReason if reason.is_result} == {
        EndReason.STOP,
        EndReason.STEP_LIMIT,
        EndReason.COLLISION,
    }


def test_a_stop_as_the_last_action_of_the_cap_is_judged_a_step_limit() -> None:
    assert judge(EndReason.STOP, 150, metres(0.1), PAPER).end_reason is EndReason.STEP_LIMIT


def test_a_stop_without_a_distance_cannot_be_judged() -> None:
    with pytest.raises(ValueError, match="distance"):
        judge(EndReason.STOP, 10, None, PAPER)


def test_another_cap_and_another_radius_are_obeyed() -> None:
    parameters = ProtocolParameters(max_actions=10, success_distance_m=0.5)
    assert end_after(10, Action.TURN_LEFT, DONE, parameters) is EndReason.STEP_LIMIT
    assert judge(EndReason.STOP, 9, metres(0.6), parameters).success is False


def test_the_verdict_says_how_the_distance_was_measured() -> None:
    text = judge(EndReason.STOP, 36, metres(0.52, PoseSource.TAPE), PAPER).text
    assert "success" in text
    assert "0.520 m from chair-1 (tape)" in text


def site_with(*objects: SiteObject) -> Site:
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    return Site(
        name="hall",
        rooms=[Room(name="hall", polygon=corners)],
        walls=[Wall(start=corners[0], end=corners[1])],
        objects=list(objects),
        starts=[StartingPosition(number=1, position=(1, 1), heading_deg=0)],
    )


def chair(number: int, x_m: float, y_m: float, size_m: float = 0.5, category: str = "chair") -> SiteObject:
    return SiteObject(id=f"{category}-{number}", category=category, position=(x_m, y_m), size_m=(size_m, size_m, 1.0))


def standing_at(x_m: float, y_m: float) -> Fix:
    return Fix(Pose(x_m, y_m, 1.0), PoseSource.SIMULATED)


def test_distance_is_measured_to_the_footprint_and_not_to_the_centre() -> None:
    measured = distance_to_goal(site_with(chair(1, 5, 5, size_m=2.0)), "chair", standing_at(3.1, 5))
    assert measured.distance_m == pytest.approx(0.9)


def test_distance_is_measured_to_a_turned_footprint() -> None:
    thing = chair(1, 5, 5, size_m=2.0).model_copy(update={"heading_deg": 45.0})
    measured = distance_to_goal(site_with(thing), "chair", standing_at(3, 5))
    assert measured.distance_m == pytest.approx(2 - 2**0.5)


def test_distance_is_measured_to_a_surveyed_outline_before_the_box() -> None:
    outlined = chair(1, 5, 5).model_copy(update={"footprint": [(4.0, 4.0), (6.0, 4.0), (5.0, 6.0)]})
    measured = distance_to_goal(site_with(outlined), "chair", standing_at(5, 3))
    assert measured.distance_m == pytest.approx(1.0)


def test_the_nearest_of_several_instances_counts_and_is_named() -> None:
    measured = distance_to_goal(site_with(chair(1, 8, 8), chair(2, 3, 1)), "chair", standing_at(1, 1))
    assert (measured.instance, measured.distance_m) == ("chair-2", pytest.approx(1.75))


def test_an_object_of_another_category_does_not_count() -> None:
    measured = distance_to_goal(
        site_with(chair(1, 1.5, 1, category="table"), chair(1, 5, 1)), "chair", standing_at(1, 1)
    )
    assert measured.distance_m == pytest.approx(3.75)


def test_a_robot_inside_the_footprint_is_at_no_distance() -> None:
    assert distance_to_goal(site_with(chair(1, 5, 5)), "chair", standing_at(5, 5)).distance_m == 0


def test_a_goal_that_the_site_lacks_has_no_distance() -> None:
    with pytest.raises(ValueError, match="no toilet"):
        distance_to_goal(site_with(chair(1, 5, 5)), "toilet", standing_at(1, 1))
