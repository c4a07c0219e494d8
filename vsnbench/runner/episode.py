"""One episode: observe, act, guard, execute, record, until the protocol says that it is over."""

import logging
import time
from dataclasses import dataclass
from typing import Protocol

from vsnbench.errors import ModelLostError, NotPlacedError, RobotError, SensorLostError
from vsnbench.models.contract import Policy
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, distance_to_goal, end_after, judge
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.protocol.step_record import StepTimings
from vsnbench.robots.contract import MadeReady, PlacedByHand, Robot, battery_of
from vsnbench.runner.depth_guard import GuardReading, get_ready, look_ahead
from vsnbench.runner.placing import PlacementLook, Placing
from vsnbench.runner.policy_calls import PolicyCalls, PolicyFailedError
from vsnbench.runner.stopping import Ends, StopAuthor, Stopped, Stopping, StopRequest

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One action of the policy, with what was seen, requested, executed and measured."""

    index: int
    """1 for the first action."""
    observation: Observation
    decision: Decision
    guard: GuardReading | None
    """What the depth guard saw; None when the action is not MOVE_FORWARD."""
    result: MotionResult | None
    """None when the guard refused the action."""
    before: Fix
    after: Fix
    timings: StepTimings

    @property
    def blocked(self) -> bool:
        """Whether the depth guard refused the action; it still counts."""
        return self.guard is not None and self.guard.blocked


@dataclass(frozen=True, slots=True)
class EpisodePlan:
    """What one episode is asked to show."""

    site: Site
    goal: str
    start: StartingPosition
    seed: int
    parameters: ProtocolParameters


@dataclass(frozen=True, slots=True)
class EpisodeOutcome:
    """How an episode ended."""

    verdict: Verdict
    actions: int
    final: Fix | None
    wall_s: float
    error: str = ""
    """What went wrong, for a void episode."""
    proposed: bool = False
    """The robot is real: the verdict counts when a person has confirmed it."""
    began: bool = True
    """False where not even the first observation could be asked for."""


class StoppedInEpisodeError(Stopped):
    """A request ended the session in the midst of an episode, which has been recorded."""

    def __init__(self, request: StopRequest, outcome: EpisodeOutcome) -> None:
        super().__init__(request)
        self.outcome = outcome


class Beside(Protocol):
    """Whoever stands beside the robot while an episode runs (`vsnbench.runner.attendant` has the whole contract)."""

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Put the robot at `start`; `problem` is what was wrong with the last attempt, `placing` measures it."""
        ...

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Be told of an action."""
        ...


class EpisodeRecorder(Protocol):
    """Whatever keeps an episode: the database, the image files, a viewer."""

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        """Return what this robot saw when it was first accepted at this start, as JPEG; None where nothing is kept."""
        ...

    def begin(self, plan: EpisodePlan, start: Fix, placed: PlacementLook | None = None) -> None:
        """Note that the episode has started; `start` is where the robot stands, as `placed` says if it was measured."""
        ...

    def step(self, step: Step) -> None:
        """Keep one step for good before the next one is taken."""
        ...

    def event(self, kind: str, text: str) -> None:
        """Keep something that happened beside the steps."""
        ...

    def intervention(self, what: str, author: str = "") -> None:
        """Keep that a person acted on the robot outside the protocol's placing; the session's operator, if unnamed."""
        ...

    def end(self, outcome: EpisodeOutcome) -> None:
        """Keep the end and the verdict."""
        ...


def run_episode(
    robot: Robot, policy: Policy, plan: EpisodePlan, recorder: EpisodeRecorder, beside: Beside, stop: Stopping
) -> EpisodeOutcome:
    """Run one episode to its end, record it step by step, and judge it.

    The robot is halted on every way out. A RecordError leaves this function at once: what cannot be kept must not
    be driven. An attempt that cannot begin is void, with its reason; a request to end this episode ends it as
    aborted, and the session may go on.

    Raises:
        Stopped: somebody asked the session to stop; the episode has been recorded as aborted or interrupted, or, where
            it had not begun, not at all.
        RecordError: the record cannot be written.
    """
    began = time.monotonic()
    calls = PolicyCalls(policy, stop)
    actions = 0
    recording = False
    battery = ""
    stopped: Stopped | None = None
    error = ""
    try:
        get_ready(robot.identity.profile.camera, robot.identity.profile.base, plan.parameters.depth_guard)
        here, placed = _stand_at_start(robot, plan, recorder, beside, stop)
        recorder.begin(plan, here, placed)
        recording = True
        battery = _note_battery(robot, recorder)
        with stop.interruptible():
            calls.reset(plan.site, plan.goal, here.pose, robot.identity.profile.base, plan.seed, plan.parameters)
        reason: EndReason | None = None
        while reason is None:
            with stop.interruptible():
                step, reason = _take_step(robot, calls, plan, actions + 1, here)
            recorder.step(step)
            actions, here = actions + 1, step.after
            beside.step_taken(plan, step)
            if step.blocked and step.guard is not None:
                recorder.event("blocked", f"action {step.index}: {step.guard.words}")
        if step.result is not None and not reason.is_result:
            error = step.result.failure
    except Stopped as acted:
        stopped = acted
        reason = EndReason.ABORTED if acted.request.author is StopAuthor.PERSON else EndReason.INTERRUPTED
        error = acted.request.words
    except PolicyFailedError as failure:
        reason, error = EndReason.MODEL_ERROR, str(failure)
    except ModelLostError as failure:
        reason, error = EndReason.MODEL_LOST, str(failure)
    except SensorLostError as failure:
        reason, error = EndReason.SENSOR_LOST, str(failure)
    except RobotError as failure:
        reason, error = EndReason.MOTION_FAILED, str(failure)
    finally:
        robot.halt()
    ends_session = stopped is not None and stopped.request.ends is Ends.SESSION
    if not recording:
        if stopped is not None and ends_session:
            raise stopped
        error = f"could not begin: {error or 'no reason given'}"
    outcome = _judged(robot, plan, reason, actions, time.monotonic() - began, error, began=recording)
    if outcome.error:
        recorder.event(outcome.verdict.end_reason.value, outcome.error)
    if stopped is not None and stopped.request.author is StopAuthor.PERSON and outcome.proposed:
        recorder.intervention(stopped.request.words, stopped.request.who)
    if recording:
        _note_battery(robot, recorder, battery)
    recorder.end(outcome)
    if stopped is not None and ends_session:
        raise StoppedInEpisodeError(stopped.request, outcome) from stopped
    return outcome


def _note_battery(robot: Robot, recorder: EpisodeRecorder, before: str = "") -> str:
    """Keep what the base says of its battery, unless that was just kept; what drifts with it can then be told."""
    said = battery_of(robot)()
    if said is not None and said.words != before:
        recorder.event("battery", said.words)
    return said.words if said is not None else ""


def _stand_at_start(
    robot: Robot, plan: EpisodePlan, recorder: EpisodeRecorder, beside: Beside, stop: Stopping
) -> tuple[Fix, PlacementLook | None]:
    """Have the robot stand at its start, put there by whoever stands beside it where it needs that.

    Returns:
        where it stands, and what was seen there where that was measured.
    """
    if not (isinstance(robot, PlacedByHand) and robot.needs_a_person):
        with stop.interruptible():
            robot.begin(plan.start, plan.seed)
            return robot.locate(), None
    if isinstance(robot, MadeReady):
        with stop.interruptible():
            robot.make_ready()
    problem = ""
    placing = Placing(robot, plan.site, plan.start, plan.seed, plan.parameters, stop, lambda: recorder.kept_photo(plan))
    while True:
        beside.place(plan.start, problem, placing)
        try:
            return placing.begin(), placing.last
        except NotPlacedError as error:
            problem = str(error)


def _take_step(
    robot: Robot, calls: PolicyCalls, plan: EpisodePlan, index: int, before: Fix
) -> tuple[Step, EndReason | None]:
    t0 = time.perf_counter()
    observation = robot.observe()
    t1 = time.perf_counter()
    decision = calls.act(observation)
    t2 = time.perf_counter()
    guard: GuardReading | None = None
    result: MotionResult | None = None
    after = before
    if decision.action is Action.MOVE_FORWARD:
        guard = look_ahead(observation, robot.identity.profile.base, plan.parameters.depth_guard)
    if guard is None or not guard.blocked:
        result = robot.execute(decision.action)
        after = robot.locate()
    timings = StepTimings(t1 - t0, t2 - t1, time.perf_counter() - t2)
    step = Step(index, observation, decision, guard, result, before, after, timings)
    return step, end_after(index, decision.action, result, plan.parameters)


def _judged(
    robot: Robot, plan: EpisodePlan, reason: EndReason, actions: int, wall_s: float, error: str, *, began: bool
) -> EpisodeOutcome:
    final: Fix | None = None
    distance: GoalDistance | None = None
    try:
        if began:
            final = robot.locate()
            distance = distance_to_goal(plan.site, plan.goal, final, plan.parameters)
    except RobotError as failure:
        if reason is EndReason.STOP:
            reason, error = EndReason.SENSOR_LOST, f"the robot's final pose is not known: {failure}"
    verdict = judge(reason, actions, distance, plan.parameters)
    by_hand = isinstance(robot, PlacedByHand) and robot.needs_a_person
    proposed = by_hand or not robot.identity.simulated
    return EpisodeOutcome(verdict, actions, final, wall_s, error, proposed, began)
