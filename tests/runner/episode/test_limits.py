"""Limits of an episode, the budget in each observation, and the task of a policy."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import NOBODY, PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.task import RobotFacts, Task
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.contract import Watch
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runner.study.output_redaction import OutputRedaction, RedactedPolicy
from vsnbench.values.decision import Decision
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Drive
from vsnbench.values.observation import Budget, Observation
from vsnbench.values.pose import Pose


@dataclass
class Told(ScriptedPolicy):
    """Keeps its task and its budgets."""

    tasks: list[Task] = field(default_factory=list)
    budgets: list[Budget | None] = field(default_factory=list)
    thinks: Callable[[], None] = lambda: None

    def begin(self, task: Task) -> None:
        self.tasks.append(task)
        super().begin(task)

    def act(self, observation: Observation) -> Decision:
        self.budgets.append(observation.budget)
        self.thinks()
        return super().act(observation)


class Mover(StandInRobot):
    """Advances by 0.25 m and 2 s with each action."""

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        self.place = self.place.compose(Pose(0.25, 0.0))
        return MotionResult(completed=True, duration_s=2.0)


def run(policy: Told, robot: StandInRobot, parameters: ProtocolParameters) -> EpisodeEnd:
    with StopRequests() as stop:
        return run_episode(robot, policy, replace(PLAN, parameters=parameters), MemoryRecorder(), NOBODY, stop)


@pytest.mark.parametrize(
    ("limits", "reason", "actions", "last"),
    [
        ({"max_time_s": 5}, EndReason.TIME_LIMIT, 3, Budget(4, 1.0)),
        ({"max_path_m": 0.9}, EndReason.PATH_LIMIT, 4, Budget(3, None, pytest.approx(0.15))),
        ({"max_time_s": 100, "max_path_m": 100}, EndReason.STEP_LIMIT, 6, Budget(1, 90.0, pytest.approx(98.75))),
        ({}, EndReason.STEP_LIMIT, 6, Budget(1)),
    ],
)
def test_the_limit_that_is_reached_first_is_the_result(
    limits: dict[str, float], reason: EndReason, actions: int, last: Budget
) -> None:
    policy = Told([Action.TURN_LEFT])
    outcome = run(policy, Mover(), ProtocolParameters.model_validate({"max_actions": 6, **limits}))
    assert (outcome.verdict.end_reason, outcome.verdict.success, outcome.actions) == (reason, False, actions)
    assert policy.budgets[-1] == last
    assert policy.budgets[0] is not None
    assert policy.budgets[0].actions_left == 6


@pytest.mark.parametrize(("simulated", "reason"), [(True, EndReason.STEP_LIMIT), (False, EndReason.TIME_LIMIT)])
def test_thinking_counts_towards_the_time_of_a_real_robot_only(simulated: bool, reason: EndReason) -> None:
    policy = Told([Action.NOOP], thinks=lambda: time.sleep(0.02))
    outcome = run(policy, Mover(simulated=simulated), ProtocolParameters(max_actions=50, max_time_s=0.1))
    assert outcome.verdict.end_reason is reason
    assert outcome.actions == 50 if simulated else outcome.actions <= 5


def test_a_policy_is_told_the_protocol_and_the_robot_through_every_wrapper() -> None:
    policy = Told([Action.STOP])
    parameters = ProtocolParameters(name="lab", turn_deg=15, max_time_s=360)
    with StopRequests() as stop:
        wrapped = RedactedPolicy(LoadedPolicy(policy), OutputRedaction(()))
        plan = replace(PLAN, parameters=parameters)
        run_episode(StandInRobot(), wrapped, plan, MemoryRecorder(), NOBODY, stop)
    protocol = ProtocolParameters(name="lab", turn_deg=15.0, max_time_s=360.0)
    robot = RobotFacts("stand-in", 0.18, 0.6, 0.7, 3.0, PROFILE.camera)
    assert policy.tasks == [Task("chair", 7, protocol, robot)]
    assert policy.asked == 1
