"""Sequences of goals: one after the other without moving the robot, each judged by itself."""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.models.looks import look
from tests.models.remote.servers import stub_server
from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import APARTMENT, NOBODY, PLAN, StandInRobot
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import WireError
from vsnbench.protocol.judge import EndReason, Verdict, judge_sequence
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.goals import GoalTarget, SiteGoal
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.sites.targets import describe_goal
from vsnbench.values.decision import Decision
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

POINT = SiteGoal(id="by-window", kind=GoalKind.POINT, targets=[GoalTarget(point=(1.6, 1.0))])
TOUR = SiteGoal(id="tour", kind=GoalKind.SEQUENCE, goals=["chair", "by-window", "bed"])
SITE = Site.model_validate({**APARTMENT.content(), "goals": [POINT.content(), TOUR.content()]})
FORGETFUL = frozenset({GoalKind.CATEGORY, GoalKind.POINT})


@dataclass
class Told(Policy):
    """Answers as scripted, and keeps what it is told."""

    script: list[Action]
    kinds: frozenset[GoalKind] = FORGETFUL
    told: list[tuple[str, str]] = field(default_factory=list)
    goals: list[str] = field(default_factory=list)
    left: list[int | None] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.card = ModelCard("told", goal_kinds=self.kinds)

    def reset(self, goal: str, seed: int) -> None:
        self.told.append(("reset", str(goal)))
        self.goals.append(goal)

    def next_goal(self, goal: str) -> None:
        self.told.append(("next_goal", str(goal)))
        self.goals.append(goal)

    def act(self, observation: Observation) -> Decision:
        self.left.append(observation.budget.actions_left if observation.budget else None)
        return Decision(self.script.pop(0))


def run(
    policy: Policy, max_actions: int = 150, robot: StandInRobot | None = None, at: tuple[float, float] = (1.6, 1.0)
) -> tuple[EpisodeEnd, MemoryRecorder]:
    recorder = MemoryRecorder()
    start = StartingPosition(number=9, position=at, heading_deg=90)
    parameters = ProtocolParameters(max_actions=max_actions)
    plan = replace(PLAN, site=SITE, goal="tour", start=start, parameters=parameters)
    with StopRequests() as stop:
        return run_episode(robot or StandInRobot(), policy, plan, recorder, NOBODY, stop), recorder


def test_stop_ends_a_leg_and_the_next_goal_is_given_where_the_robot_is() -> None:
    outcome, recorder = run(Told([Action.STOP, Action.TURN_LEFT, Action.STOP, Action.STOP]))
    assert [(leg.position, leg.goal, leg.end_reason, leg.actions) for leg in outcome.legs] == [
        (1, "chair", "stop", 1),
        (2, "by-window", "stop", 2),
        (3, "bed", "stop", 1),
    ]
    assert [leg.success for leg in outcome.legs] == [False, True, False]
    assert outcome.legs[1].goal_instance == "point:1"
    assert [step.index for step in recorder.steps] == [1, 2, 3, 4]
    assert (outcome.actions, outcome.verdict.success, outcome.end_reason) == (4, False, EndReason.STOP)
    assert [kind for kind, _ in recorder.events] == ["leg", "leg"]


def test_a_model_keeps_its_memory_if_its_card_says_so_and_else_begins_again() -> None:
    keeps = Told([Action.STOP] * 3, FORGETFUL | {GoalKind.SEQUENCE})
    outcome, _ = run(keeps)
    assert [call for call, _ in keeps.told] == ["reset", "next_goal", "next_goal"]
    assert [leg.memory for leg in outcome.legs] == [True, True, True]
    forgets = Told([Action.STOP] * 3)
    outcome, _ = run(forgets)
    assert forgets.told == [("reset", "chair"), ("reset", "by-window"), ("reset", "bed")]
    assert [leg.memory for leg in outcome.legs] == [True, False, False]


def test_a_point_is_told_in_the_frame_of_the_start() -> None:
    policy = Told([Action.STOP] * 3)
    run(policy, at=(1.6, -1.0))
    goal = policy.goals[1]
    assert isinstance(goal, Goal)
    assert (goal.kind, goal.point) == (GoalKind.POINT, pytest.approx((2.0, 0.0)))


def test_each_leg_has_limits_of_its_own() -> None:
    policy = Told([Action.TURN_LEFT, Action.TURN_LEFT, Action.STOP, Action.TURN_LEFT, Action.TURN_LEFT])
    outcome, _ = run(policy, max_actions=2)
    assert [leg.end_reason for leg in outcome.legs] == ["step_limit", "stop", "step_limit"]
    assert policy.left == [2, 1, 2, 2, 1]
    assert (outcome.actions, outcome.end_reason) == (5, EndReason.STEP_LIMIT)


def test_a_collision_ends_the_sequence() -> None:
    touched = MotionResult(completed=False, collision=Collision(CollisionSource.CONTACT, "sofa-1"))
    robot = StandInRobot(on_execute=lambda _: touched)
    outcome, _ = run(Told([Action.MOVE_FORWARD, Action.STOP, Action.STOP]), robot=robot)
    assert [(leg.goal, leg.end_reason, leg.success) for leg in outcome.legs] == [("chair", "collision", False)]
    assert (outcome.verdict.success, outcome.end_reason) == (False, EndReason.COLLISION)


@pytest.mark.parametrize(
    ("earlier", "last", "success"),
    [([True, True], True, True), ([True, False], True, False), ([True, True], False, False), ([True], True, False)],
)
def test_a_sequence_succeeds_if_every_goal_was_reached(earlier: Sequence[bool], last: bool, success: bool) -> None:
    verdict = judge_sequence(earlier, Verdict(EndReason.STOP, last, "it"), 3)
    assert verdict.success is success
    assert verdict.text.startswith(f"{'success' if success else 'failed'}: {[*earlier, last].count(True)} of 3")


def test_a_void_leg_voids_the_sequence() -> None:
    outcome, _ = run(Told([Action.STOP]))  # the script ends: the policy raises an exception
    assert (outcome.verdict.success, outcome.end_reason) == (None, EndReason.MODEL_ERROR)
    assert [leg.success for leg in outcome.legs] == [False, None]


SERVED = """
class Model:
    card = {"name": "told", "sensors": [], "goal_kinds": ["category", "point", "route", "sequence"]}

    def reset(self, goal, seed):
        self.told = [["reset", str(goal), goal.kind, goal.point, [int(image.sum()) for image in goal.images]]]

    def next_goal(self, goal):
        self.told.append(["next_goal", str(goal), goal.kind, goal.point, []])

    def act(self, observation):
        return {"action": "STOP", "diagnostics": {"note": repr(self.told)}}
"""


def test_a_served_model_is_told_the_next_goal_and_keeps_its_memory(tmp_path: Path) -> None:
    with stub_server(SERVED, tmp_path) as (address, _):
        policy = RemotePolicy(address)
        outcome, recorder = run(policy)
        policy.close()
    assert ast.literal_eval(recorder.steps[-1].decision.diagnostics.note) == [
        ["reset", "chair", "category", None, []],
        ["next_goal", "by-window", "point", (0.0, 0.0), []],
        ["next_goal", "bed", "category", None, []],
    ]
    assert [leg.memory for leg in outcome.legs] == [True, True, True]


def test_a_served_model_gets_the_photographs_of_a_route_in_order(tmp_path: Path) -> None:
    images = [np.full((48, 64, 3), number, np.uint8) for number in (3, 1, 2)]
    with stub_server(SERVED, tmp_path) as (address, _):
        policy = RemotePolicy(address)
        policy.reset(Goal("way", GoalKind.ROUTE, images=images), 1)
        note = policy.act(look()).diagnostics.note
        policy.close()
    assert ast.literal_eval(note) == [["reset", "way", "route", None, [int(image.sum()) for image in images]]]


@pytest.mark.parametrize(
    "fields",
    [
        {"kind": "sequence"},
        {"kind": "point"},
        {"kind": "point", "point": [1.0]},
        {"kind": "point", "point": [1.0, float("nan")]},
        {"kind": "route", "images": []},
        {"kind": "route", "images": [{}]},
        {"kind": "text", "text": "x", "point": [1.0, 2.0]},
    ],
)
def test_a_message_with_an_invalid_goal_is_refused(fields: dict[str, object]) -> None:
    with pytest.raises(WireError):
        vsnbench_policy.Goal.of({"goal": "a", "goal_fields": fields})


def test_a_served_model_that_claims_memory_needs_the_method() -> None:
    claims = SimpleNamespace(card={"name": "claims", "goal_kinds": ["category", "sequence"]})
    with pytest.raises(ValueError, match="next_goal"):
        vsnbench_policy.checked_card(claims)


def test_a_policy_never_receives_the_sequence_itself() -> None:
    with pytest.raises(ValueError, match="one by one"):
        describe_goal(SITE, "tour", Pose(0.0, 0.0))
