"""Bad answers, in process and over the wire: the robot stays at rest, and the episode is recorded with its reason."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from websockets.sync.server import ServerConnection

from tests.models.remote.servers import CARD, scripted_server
from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.episode.test_step import Scripted
from tests.runner.stand_ins import NOBODY, PLAN, StandInRobot
from vsnbench.errors import UsageError
from vsnbench.models.contract import Policy
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import pack
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.setup.trial_setup import TrialSetupSpec, prepare_setup
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import StartingPosition
from vsnbench.values.movement import Action, ActionKind, Chunk, Movement, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

NEAR_A_WALL = StartingPosition(number=1, position=(9.2, 3.2), heading_deg=90)
NEAR_THE_CLOSED_DOOR = StartingPosition(number=1, position=(9.2, 3.0), heading_deg=0)
BAD: dict[str, tuple[Movement | Chunk, dict[str, Any]]] = {
    "NaN": (Waypoint(math.nan, 0.0), {"movement": {"kind": "waypoint", "x_m": math.nan, "y_m": 0.0}}),
    "infinity": (Waypoint(0.0, math.inf), {"movement": {"kind": "waypoint", "x_m": 0.0, "y_m": math.inf}}),
    "10 km": (Waypoint(10_000.0, 0.0), {"movement": {"kind": "waypoint", "x_m": 10_000, "y_m": 0}}),
    "9 m/s": (Velocity(9.0, 0.0, 1.0), {"movement": {"kind": "velocity", "linear_m_s": 9.0, "duration_s": 1.0}}),
    "an hour": (Velocity(0.1, 0.0, 3600.0), {"movement": {"kind": "velocity", "linear_m_s": 0.1, "duration_s": 3600}}),
    "10,000 parts": (Chunk((Action.TURN_LEFT,) * 10_000), {"parts": ["TURN_LEFT"] * 10_000}),
    "one point": (Trajectory(((1.0, 0.0),)), {"movement": {"kind": "trajectory", "points": [[1.0, 0.0]]}}),
    "10,000 points": (
        Trajectory(((1.0, 0.0),) * 10_000),
        {"movement": {"kind": "trajectory", "points": [[1.0, 0.0]] * 10_000}},
    ),
}
ONLY_WIRE: dict[str, dict[str, Any]] = {
    "an unknown kind": {"movement": {"kind": "teleport", "x_m": 1}},
    "no kind": {"movement": {"x_m": 1, "y_m": 1}},
    "a movement that is no map": {"movement": [1, 2]},
    "a coordinate that is missing": {"movement": {"kind": "waypoint", "x_m": 1}},
    "text as a number": {"movement": {"kind": "waypoint", "x_m": "far", "y_m": 0}},
    "parts that are no list": {"parts": {"0": "STOP"}},
    "a chunk in a chunk": {"parts": [{"kind": "chunk", "parts": ["STOP"]}]},
    "points that are none": {"movement": {"kind": "trajectory", "points": [[1], [2]]}},
}


def run(policy: Policy, start: StartingPosition = NEAR_A_WALL) -> tuple[EpisodeEnd, MemoryRecorder, Pose]:
    """Run an episode; return also the robot's final pose."""
    recorder = MemoryRecorder()
    plan = replace(PLAN, start=start, parameters=ProtocolParameters(max_actions=6))
    with StopRequests() as stop, SimulatedRobot(plan.site, load_profile("turtlebot2")) as robot:
        outcome = run_episode(robot, policy, plan, recorder, NOBODY, stop)
        robot.observe()
        return outcome, recorder, robot.locate().pose


def answering(answer: dict[str, Any]) -> Callable[[ServerConnection, dict[str, Any]], None]:
    def reply(connection: ServerConnection, message: dict[str, Any]) -> None:
        kind: dict[str, Any] = {"type": "ready"} if message["type"] == "reset" else {"type": "decision", **answer}
        connection.send(pack({**kind, "seq": message["seq"]}))

    return reply


def assert_never_moved(result: tuple[EpisodeEnd, MemoryRecorder, Pose]) -> None:
    outcome, recorder, pose = result
    assert outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert outcome.verdict.success is None
    assert outcome.error.startswith("act: ")
    assert "\n" not in outcome.error
    assert recorder.outcome is outcome
    assert recorder.steps == []
    assert pose.distance_to(NEAR_A_WALL.pose) < 0.01


@pytest.mark.parametrize("name", BAD)
def test_an_impossible_answer_in_process_is_a_model_error_at_rest(name: str) -> None:
    assert_never_moved(run(Scripted(BAD[name][0])))


@pytest.mark.parametrize("name", [*BAD, *ONLY_WIRE])
def test_an_impossible_answer_over_the_wire_is_a_model_error_at_rest(name: str) -> None:
    message = BAD[name][1] if name in BAD else ONLY_WIRE[name]
    card = {**CARD, "action_kinds": sorted(ActionKind)}
    with scripted_server(answering(message), {"type": "card", "wire": 2, "card": card, "jpeg": False}) as url:
        policy = RemotePolicy(url)
        try:
            assert_never_moved(run(policy))
        finally:
            policy.close()


@pytest.mark.parametrize(
    ("start", "free_m"), [(NEAR_A_WALL, 0.5), (NEAR_THE_CLOSED_DOOR, 0.9)], ids=["in a wall", "behind a closed door"]
)
@pytest.mark.parametrize(
    "answer",
    [Waypoint(3.0, 0.0), Trajectory(((1.5, 0.0), (3.0, 0.0))), Velocity(0.5, 0.0, 2.0)],
    ids=["waypoint", "trajectory", "velocity"],
)
def test_a_movement_into_an_obstacle_is_blocked_before_it(
    start: StartingPosition, free_m: float, answer: Movement
) -> None:
    outcome, recorder, pose = run(Scripted(answer, answer, answer, answer), start)
    assert outcome.verdict.end_reason is EndReason.STOP
    assert recorder.steps[-2].blocked
    assert all(step.result is None or step.result.collision is None for step in recorder.steps)
    assert pose.distance_to(start.pose) < free_m
    assert len(recorder.steps) == 5


@pytest.mark.parametrize("kind", [ActionKind.WAYPOINT, ActionKind.VELOCITY, ActionKind.PIXEL])
def test_a_kind_that_the_robot_cannot_do_is_refused_before_a_trial(kind: ActionKind) -> None:
    policy = LoadedPolicy(Scripted(kinds=frozenset({ActionKind.DISCRETE, kind})))
    robot = StandInRobot()
    with pytest.raises(UsageError) as refused:
        prepare_setup(TrialSetupSpec(PLAN.site, "scripted", ("chair",)), policy, robot)
    assert refused.value.code == "unsupported-action-kind"
    assert robot.executed == []


def test_a_model_that_moves_sideways_is_refused_on_a_base_on_two_wheels() -> None:
    policy = LoadedPolicy(Scripted(kinds=frozenset({ActionKind.DISCRETE, ActionKind.SIDESTEP})))
    with (
        SimulatedRobot(PLAN.site, load_profile("turtlebot2")) as robot,
        pytest.raises(UsageError) as refused,
    ):
        prepare_setup(TrialSetupSpec(PLAN.site, "scripted", ("chair",)), policy, robot)
    assert refused.value.code == "unsupported-action-kind"
    assert "max_lateral_m_s" in refused.value.advice


LOOKS = Chunk((Action.TURN_LEFT, Action.LOOK_DOWN, Action.LOOK_UP))
MAP = {Action.LOOK_UP: Action.NOOP, Action.LOOK_DOWN: Action.TURN_RIGHT}


@pytest.mark.parametrize("answers", [LOOKS.parts, (LOOKS,)], ids=["one by one", "in a chunk"])
def test_a_tilt_is_what_the_card_maps_it_to(answers: tuple[Action | Chunk, ...]) -> None:
    policy = Scripted(*answers)
    policy.card = replace(policy.card, action_map=MAP)
    outcome, recorder, pose = run(policy)
    executed = [(step.decision.action, step.decision.raw_action) for step in recorder.steps]
    assert executed == [
        (Action.TURN_LEFT, "TURN_LEFT"),
        (Action.TURN_RIGHT, "LOOK_DOWN"),
        (Action.NOOP, "LOOK_UP"),
        (Action.STOP, "STOP"),
    ]
    assert outcome.actions == 4
    assert recorder.steps[2].site_before == recorder.steps[2].site_after
    assert pose.distance_to(NEAR_A_WALL.pose) < 0.01


@pytest.mark.parametrize("answer", [Action.LOOK_UP, Chunk((Action.TURN_LEFT, Action.LOOK_DOWN))])
def test_a_tilt_that_the_card_does_not_map_is_a_model_error_that_names_the_field(answer: Action | Chunk) -> None:
    result = run(Scripted(answer))
    assert_never_moved(result)
    assert "action_map={Action.LOOK_" in result[0].error


@pytest.mark.parametrize("mapped", [{"LOOK_UP": "NOOP"}, None])
def test_a_tilt_over_the_wire_is_what_the_card_maps_it_to(mapped: dict[str, str] | None) -> None:
    card = {**CARD, "action_map": mapped}
    reply = answering({"action": "LOOK_UP"})
    with scripted_server(reply, {"type": "card", "wire": 2, "card": card, "jpeg": False}) as url:
        policy = RemotePolicy(url)
        outcome, recorder, _ = run(policy)
        policy.close()
    expected = (EndReason.STEP_LIMIT, 6) if mapped else (EndReason.MODEL_ERROR, 0)
    assert (outcome.verdict.end_reason, outcome.actions) == expected
    assert {(step.decision.action, step.decision.raw_action) for step in recorder.steps} <= {(Action.NOOP, "LOOK_UP")}
