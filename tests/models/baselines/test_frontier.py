"""The built-in model `frontier` drives to unseen areas and to the goal."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.models.vlv.looks import look
from vsnbench.errors import ModelError, UsageError
from vsnbench.models.baselines.frontier import Frontier
from vsnbench.models.baselines.waypoint_frontier import WaypointFrontier
from vsnbench.models.registry import create_policy
from vsnbench.models.task import task_of
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action, ActionKind, Trajectory, Waypoint
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

PERFECT = VLVSettings(simulated_recall=1.0, simulated_precision=1.0)


@pytest.fixture(autouse=True)
def no_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))


def frontier(goal: str = "sofa") -> Frontier:
    policy = Frontier(model_config=PERFECT)
    policy.reset(goal, seed=1)
    return policy


def test_it_is_a_model_of_its_own_with_vlv_s_detector() -> None:
    policy, vlv = create_policy("frontier"), VLV()
    assert policy.card.name == "frontier"
    assert policy.card.weights_label in vlv.card.weights_label
    assert "value" not in policy.card.weights_label
    assert (policy.card.goals, policy.card.sensors) == (vlv.card.goals, vlv.card.sensors)


def test_a_value_network_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "vlv_model.torch").write_bytes(b"not read")
    assert frontier().card.weights_sha256 == ""


def test_it_looks_around_once_and_then_drives_to_the_edge_of_the_known_area() -> None:
    policy = frontier()
    assert [policy.act(look()).action for _ in range(12)] == [Action.TURN_LEFT] * 12
    decision = policy.act(look())
    assert decision.diagnostics is not None
    assert decision.diagnostics.note == "travel: to the nearest frontier"
    assert decision.diagnostics.sub_goal is not None


def test_it_stops_at_a_goal_that_it_sees_nearby() -> None:
    policy = frontier()
    near = look(("sofa", (50, 110, 30, 130), 0.7))
    assert [policy.act(near).action is Action.STOP for _ in range(2)] == [False, True]


def test_an_unknown_goal_and_an_early_act_are_refused_by_name() -> None:
    with pytest.raises(UsageError, match="frontier does not know the goal 'plant'"):
        frontier("plant")
    with pytest.raises(ModelError, match="frontier: act was called before reset"):
        Frontier().act(look())


def driving(execution: Execution | None = None) -> WaypointFrontier:
    """Return the model that answers with waypoints, at the begin of an episode; by default the robot rests."""
    policy = WaypointFrontier(model_config=PERFECT)
    parameters = ProtocolParameters().executed(execution)
    policy.begin(task_of("sofa", 1, parameters, load_profile("turtlebot2")))
    return policy


def seen(now_s: float, heading_deg: float) -> Observation:
    """Return a view of a round room with an opening around 90 degrees."""
    wall_m = 9.0 if abs(heading_deg % 360 - 90) <= 30 else 3.0
    return replace(look(pose=Pose.from_degrees(0.0, 0.0, heading_deg), wall_m=wall_m), stamp_s=now_s)


def turn_deg(answer: Decision) -> int:
    assert isinstance(answer.movement, Waypoint)
    assert answer.movement.heading_rad is not None
    assert (answer.movement.x_m, answer.movement.y_m) == (0.0, 0.0)
    return round(math.degrees(answer.movement.heading_rad))


def is_occupied(answer: Decision, point: Pose) -> bool:
    grid = answer.diagnostics.map
    assert grid is not None
    row, column = (
        (at - origin) / grid.resolution_m for at, origin in ((point.y_m, grid.origin_y_m), (point.x_m, grid.origin_x_m))
    )
    return bool(grid.cells[int(row), int(column)] == 2)


def test_at_rest_it_answers_with_a_heading_for_each_view_of_a_scan_and_then_with_a_short_path() -> None:
    policy = driving()
    assert policy.card.action_kinds >= {ActionKind.WAYPOINT, ActionKind.TRAJECTORY}
    assert [turn_deg(policy.act(seen(3.0 * k, 30.0 * k))) for k in range(12)] == [30] * 12
    aside = turn_deg(policy.act(seen(36.0, 0.0)))
    assert 60 < aside < 120, "first it turns to the opening"
    path = policy.act(seen(39.0, aside)).movement
    assert isinstance(path, Trajectory)
    assert 0.9 < path.length_m < 1.3


def test_while_the_robot_drives_on_a_scan_ends_when_it_has_turned_around_once() -> None:
    policy = driving(Execution(latency_s=0.3))
    first = [turn_deg(policy.act(seen(0.3 * k, 9.0 * k))) for k in range(4)]
    assert first == [60, 51, 42, 60], "the same heading, until there is something new to see"
    answers = [policy.act(seen(0.3 * k, 9.0 * k)) for k in range(4, 48)]
    scans = [answer for answer in answers if answer.diagnostics.note.startswith("scan")]
    assert 34 <= len(scans) + 4 <= 41
    assert isinstance(answers[-1].movement, Trajectory)


def test_a_path_that_the_guard_refuses_is_marked_as_an_obstacle_after_a_while() -> None:
    policy = driving(Execution(latency_s=0.3))
    for k in range(48):
        policy.act(seen(0.3 * k, 9.0 * k))
    before = [policy.act(seen(14.4 + 0.3 * k, 63.0)) for k in range(5)]
    after = [policy.act(seen(15.9 + 0.3 * k, 63.0)) for k in range(13)]
    ahead = Pose.from_degrees(0.0, 0.0, 63.0).compose(Pose(0.377, 0.0))
    assert [is_occupied(answer, ahead) for answer in before] == [False] * 5
    assert is_occupied(after[-1], ahead)
    assert [answer.diagnostics.path for answer in (before[-1], after[-1])].count(after[-1].diagnostics.path) == 1


def test_where_the_guard_keeps_the_robot_its_paths_are_short_and_their_end_is_given_up_in_the_end() -> None:
    policy = driving(Execution(latency_s=0.3))
    for k in range(48):
        policy.act(seen(0.3 * k, 9.0 * k))
    answers = [policy.act(seen(14.4 + 0.3 * k, 63.0)) for k in range(60)]
    ways = [answer for answer in answers if not isinstance(answer.movement, Waypoint) or answer.movement.x_m]
    short = [answer.movement for answer in ways if isinstance(answer.movement, Waypoint)]
    assert isinstance(ways[0].movement, Trajectory)
    assert short
    assert all(math.hypot(way.x_m, way.y_m) == pytest.approx(0.1) for way in short)
    assert isinstance(ways[-1].movement, Waypoint), "the robot has not left"
    ends = [answer.diagnostics.path[-1] for answer in ways]
    assert math.dist(ends[0], ends[-1]) > 0.3, "another frontier"


def test_while_the_robot_drives_on_it_stops_at_a_goal_that_two_views_show() -> None:
    policy = driving(Execution(latency_s=0.3))
    near = ("sofa", (50, 110, 30, 130), 0.7)
    answers = [policy.act(replace(look(near), stamp_s=0.3 * k)).action for k in range(6)]
    assert answers.index(Action.STOP) == 4, "an observation within a second is no second view"
