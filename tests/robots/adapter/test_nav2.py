"""The adapter for Nav2, against action servers that behave as those of Nav2."""

import math
from itertools import pairwise
from typing import Any

import pytest

from tests.robots.adapter.adapters import by_velocity
from tests.robots.adapter.nav2_stand_in import TYPES, Nav2StandIn
from vsnbench.sensing.movement_check import contradiction
from vsnbench.values.encoding.motion_answer import result_of_answer
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive, Move, Trajectory, Velocity, Waypoint

import nav2_adapter  # isort: skip  # adapters has its path


@pytest.fixture
def nav2(monkeypatch: pytest.MonkeyPatch) -> Nav2StandIn:
    monkeypatch.setattr(nav2_adapter, "REST_S", 0.0)
    return Nav2StandIn()


class Adapter(nav2_adapter.Nav2):
    """The adapter with the odometry of the stand-in, whose robot moves at once."""

    def __init__(self, nav2: Nav2StandIn) -> None:
        self._nav2 = nav2
        super().__init__(None, nav2.clients, TYPES)

    @property
    def pose(self) -> tuple[float, float, float]:
        return self._nav2.pose()

    @pose.setter
    def pose(self, _: object) -> None:
        """Leave out the odometry's first value."""


def driven(nav2: Nav2StandIn, movement: Drive, *, leaves_after: int = 10**6, deadline_s: float = 30.0) -> MotionResult:
    """Execute a movement for a client that leaves after some steps."""
    running = by_velocity.Movement(Adapter(nav2))
    running.begin({"movement": movement.to_json(), "deadline_s": deadline_s})
    steps = 0
    while running.runs and steps < leaves_after:
        running.go_on(0.0)
        steps += 1
    running.stop()
    return result_of_answer(running.ended)


@pytest.mark.parametrize(
    ("movement", "actions"),
    [
        (Move(0.25, holds_heading=True), ["follow_path"]),
        (Move(turn_rad=math.radians(30), holds_heading=True), ["spin"]),
        (Move(-0.25), ["backup"]),
        (Move(1.0, -0.7), ["spin", "follow_path"]),
        (Waypoint(1.0, 0.5), ["navigate_to_pose"]),
        (Waypoint(1.0, 0.5, 1.0), ["navigate_to_pose"]),
        (Trajectory(((1.0, 0.0), (1.5, 0.5))), ["follow_path"]),
    ],
)
def test_movements_are_actions_whose_end_is_that_of_the_movement(
    nav2: Nav2StandIn, movement: Drive, actions: list[str]
) -> None:
    before = nav2.at
    assert driven(nav2, movement).completed
    assert [name for name, _ in nav2.goals] == actions
    assert not contradiction(movement, before, nav2.at, miss_m=2 * 0.05)


def test_a_path_has_a_pose_every_five_centimetres(nav2: Nav2StandIn) -> None:
    driven(nav2, Trajectory(((1.0, 0.0), (1.0, 0.5))))
    ((_, goal),) = nav2.goals
    points = [(pose.pose.position.x, pose.pose.position.y) for pose in goal.path.poses]
    gaps = [math.dist(a, b) for a, b in pairwise(points)]
    assert max(gaps) <= 0.05 + 1e-9
    assert {pose.header.frame_id for pose in goal.path.poses} == {"odom"}


@pytest.mark.parametrize(
    ("code", "text", "check"),
    [
        (105, "no progress", lambda result: result.blocked == "follow_path: no progress (105)"),
        (106, "", lambda result: result.blocked == "follow_path: error (106)"),
        (102, "no transform", lambda result: result.sensor_lost),
        (107, "timed out", lambda result: result.failure == "follow_path: timed out (107)"),
        (101, "no controller", lambda result: result.failure == "follow_path: no controller (101)"),
    ],
)
def test_error_codes_become_refusals(nav2: Nav2StandIn, code: int, text: str, check: Any) -> None:
    nav2.error = code, text
    result = driven(nav2, Move(0.25))
    assert not result.completed
    assert check(result), result


def test_a_goal_of_another_client_is_a_rival(nav2: Nav2StandIn) -> None:
    nav2.preempted = True
    assert driven(nav2, Move(0.25)).failure == "another client ended the goal of follow_path"


def test_a_rejected_goal_is_a_fault(nav2: Nav2StandIn) -> None:
    nav2.accepts = False
    assert driven(nav2, Move(0.25)).failure == "follow_path has rejected the goal"


def test_a_client_that_is_gone_cancels_the_goal(nav2: Nav2StandIn) -> None:
    nav2.never_ends = True
    result = driven(nav2, Move(0.25), leaves_after=10)
    assert (result.completed, nav2.cancelled) == (False, 1)
    assert "the client is gone" in result.failure


def test_a_deadline_cancels_the_goal(nav2: Nav2StandIn) -> None:
    nav2.never_ends = True
    assert driven(nav2, Move(0.25), deadline_s=0.0).failure == "follow_path took too long"
    assert nav2.cancelled == 1


def test_a_velocity_is_refused(nav2: Nav2StandIn) -> None:
    assert driven(nav2, Velocity(0.2)).failure == "Nav2 has no action for velocity"


def test_it_says_which_server_is_missing(nav2: Nav2StandIn) -> None:
    adapter = Adapter(nav2)
    assert adapter.missing == ""
    nav2.accepts = False
    assert adapter.missing == "no action server follow_path"
