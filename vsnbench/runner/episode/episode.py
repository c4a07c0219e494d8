"""One episode: observe, act, guard, execute and record until the protocol ends it."""

import logging
import time
from dataclasses import replace
from typing import Protocol

from vsnbench.errors import ModelLostError, NotPlacedError, RobotError, SensorLostError
from vsnbench.models.contract import Policy
from vsnbench.models.task import task_of
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.judge import EndReason, GoalDistance, distance_to_goal, judge, judge_sequence
from vsnbench.protocol.limits import Spent
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd, SequenceLeg, leg_of
from vsnbench.robots.contract import Robot
from vsnbench.runner.disturbances.policy_view import PolicyView
from vsnbench.runner.episode.continuous import ContinuousStepper
from vsnbench.runner.episode.depth_guard import get_ready
from vsnbench.runner.episode.policy_calls import PolicyCalls, PolicyFailedError
from vsnbench.runner.episode.step import EpisodePlan, Step, Stepper
from vsnbench.runner.episode.stop_measurement import StopMeasurement
from vsnbench.runner.operator.placing import PlacementLook, Placing
from vsnbench.runner.stopping.requests import Ends, StopAuthor, Stopped, StopRequest, StopRequests
from vsnbench.sites.site import StartingPosition
from vsnbench.sites.targets import legs_of
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.observation import Sensor
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)


class StoppedInEpisodeError(Stopped):
    """A request ended the session during an episode, which has been recorded."""

    def __init__(self, request: StopRequest, outcome: EpisodeEnd) -> None:
        super().__init__(request)
        self.outcome = outcome


class EpisodeOperator(Protocol):
    """What an episode needs of the operator; see `vsnbench.runner.operator.contract.Operator`."""

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Have the robot put at a starting position, and return when it may drive."""
        ...

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show an action."""
        ...

    def asks_where(self, *, can_measure: bool) -> bool:
        """Return whether the operator has asked for the robot's pose."""
        ...

    def show_where(self, text: str) -> None:
        """Show the answer."""
        ...

    def show_message(self, text: str) -> None:
        """Show a line, such as how to start a stack."""
        ...

    def says_arrived(self) -> bool:
        """Return whether the operator has said that the robot has arrived."""
        ...


class EpisodeRecorder(Protocol):
    """Records an episode: in the database, as image files, and in a viewer."""

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        """Return the image from when this robot was first accepted at this start, as JPEG; None if there is none."""
        ...

    def begin(self, plan: EpisodePlan, start: Fix, begin: EpisodeBegin, view_jpeg: bytes | None = None) -> None:
        """Record the begin at pose `start`; `view_jpeg` is what a robot that was accepted at its mark sees there."""
        ...

    def step(self, step: Step) -> None:
        """Record a step."""
        ...

    def event(self, kind: str, text: str) -> None:
        """Record an event other than a step."""
        ...

    def intervention(self, what: str, author: str = "") -> None:
        """Record that a person acted on the robot other than by placing it; by default the session's operator."""
        ...

    def end(self, outcome: EpisodeEnd) -> None:
        """Record the end and the verdict."""
        ...


def run_episode(
    robot: Robot,
    policy: Policy,
    plan: EpisodePlan,
    recorder: EpisodeRecorder,
    operator: EpisodeOperator,
    stop: StopRequests,
) -> EpisodeEnd:
    """Run one episode to its end, record each step, and judge it.

    The robot is halted on every exit, and a motion that a request to stop interrupts is a step as well. A RecordError
    ends the episode at once, because no robot may drive unrecorded. An attempt that cannot begin is void, with its
    reason. A request to end the episode makes it aborted, and the session continues.

    Raises:
        Stopped: a request to end the session. The episode is recorded as aborted or interrupted, or not at all if it
            had not begun.
        RecordError: the results cannot be written.
    """
    began = time.monotonic()
    calls = PolicyCalls(policy, stop, operator.says_arrived)
    spent = Spent()
    recording = False
    battery = ""
    stopped: Stopped | None = None
    stepper: Stepper | None = None
    looks: StopMeasurement | None = None
    error = ""
    base = robot.identity.profile.base
    goals, legs = legs_of(plan.site, plan.goal), list[SequenceLeg]()
    leg, leg_from, actions = replace(plan, goal=goals[0]), Pose(0.0, 0.0), 0
    try:
        get_ready(robot.identity.profile.camera, base, plan.parameters.depth_guard)
        here, placed = _place_at_start(robot, plan, recorder, operator, stop)
        measured = None if placed is None else placed.measured
        accepted = measured is not None and measured.within_tolerance
        view_jpeg = placed.picture_jpeg if placed is not None and accepted else None
        recorder.begin(plan, here, EpisodeBegin(measured=measured), view_jpeg)
        recording = True
        battery = _note_battery(robot, recorder)
        with stop.interruptible():
            view = PolicyView(plan.disturbances, robot, plan.seed)
            profile = robot.identity.profile.model_copy(update={"camera": view.camera})
            task = task_of(leg.goal, plan.seed, plan.parameters, profile)
            calls.begin(plan.site, here.pose, task, plan.parameters, base)
        if calls.announcement:
            operator.show_message(calls.announcement)
        reason: EndReason | None = None
        looks, leg_from = _stop_measurement(robot, leg, here, placed), here.pose
        stepper_class = Stepper if plan.parameters.execution is None else ContinuousStepper
        stepper = stepper_class(robot, calls, view, plan, here, stop)
        while reason is None:
            step, reason = stepper.take(spent, here)
            recorder.step(step)
            spent, here, actions = step.spent, step.site_after, step.index
            if looks is not None:
                looks.look(step.observation)
            operator.step_taken(plan, step)
            if step.answer is not None and step.answer.stale:
                recorder.event("stale", f"the answer was {step.answer.age_s:.1f} s old, and was dropped")
            if step.blocked:
                recorder.event("blocked", step.refusal)
                if reason is None and step.guard is not None:
                    stepper.watch.refused(step.guard)
            rests = looks is not None and plan.parameters.execution is None
            if operator.asks_where(can_measure=rests) and looks is not None and reason is None:
                where = looks.whereabouts(robot.observe())
                recorder.event("whereabouts", where)
                operator.show_where(where)
            if reason is not None and reason.ends_leg and len(legs) + 1 < len(goals):
                end = _judged(robot, leg, reason, spent.actions, 0.0, "", began=True)
                end = end if looks is None else looks.judged(end)
                if not end.end_reason.is_result:  # where the robot stands is not known
                    reason, error = end.end_reason, end.error
                    continue
                legs.append(_leg_of(robot, leg, leg_from, spent, end, len(legs), calls))
                recorder.event("leg", f"goal {len(legs)} of {len(goals)}, {leg.goal}: {end.verdict.text}")
                reason, spent, leg_from = None, Spent(), here.pose
                leg = replace(plan, goal=goals[len(legs)])
                if looks is not None:
                    looks.search(leg.goal)
                stepper.begin_leg()
                with stop.interruptible():
                    seed = (plan.seed + len(legs)) % 2**32
                    calls.next_goal(plan.site, replace(task, goal=leg.goal, seed=seed), plan.parameters, base)
        if step.result is not None and not reason.is_result:
            error = error or step.result.failure
    except Stopped as acted:
        stopped = acted
        reason = EndReason.ABORTED if acted.request.author is StopAuthor.PERSON else EndReason.INTERRUPTED
        error = acted.request.description
    except PolicyFailedError as failure:
        reason, error = EndReason.MODEL_ERROR, str(failure)
    except ModelLostError as failure:
        reason, error = EndReason.MODEL_LOST, str(failure)
    except SensorLostError as failure:
        reason, error = EndReason.SENSOR_LOST, str(failure)
    except RobotError as failure:
        reason, error = EndReason.MOTION_FAILED, str(failure)
    finally:
        stop.at_once = None
        robot.halt()
        if plan.parameters.execution is None:  # while the robot drives on, the model learns it before the base rests
            calls.end()
    if stepper is not None and (cut := stepper.interrupted) is not None:
        recorder.step(cut)
        spent, actions = cut.spent, cut.index
    ends_session = stopped is not None and stopped.request.ends is Ends.SESSION
    if not recording:
        if stopped is not None and ends_session:
            raise stopped
        error = f"could not begin: {error or 'no reason given'}"
    outcome = _judged(robot, leg, reason, spent.actions, time.monotonic() - began, error, began=recording)
    if looks is not None:
        outcome = looks.judged(outcome)
    if len(goals) > 1 and recording:
        verdict = judge_sequence([earlier.success for earlier in legs], outcome.verdict, len(goals))
        legs.append(_leg_of(robot, leg, leg_from, spent, outcome, len(legs), calls))
        outcome = replace(outcome, verdict=verdict, actions=actions, legs=tuple(legs))
    if recording and robot.driven_against:
        recorder.event("drives_on", f"{robot.driven_against} drove on after the end; the base was held at rest")
    if outcome.error:
        recorder.event(outcome.verdict.end_reason.value, outcome.error)
    if stopped is not None and stopped.request.author is StopAuthor.PERSON and outcome.proposed:
        recorder.intervention(stopped.request.description, stopped.request.who)
    if recording:
        _note_battery(robot, recorder, battery)
    recorder.end(outcome)
    if stopped is not None and ends_session:
        raise StoppedInEpisodeError(stopped.request, outcome) from stopped
    return outcome


def _note_battery(robot: Robot, recorder: EpisodeRecorder, before: str = "") -> str:
    """Record the battery if it has changed since the event `before`. Returns its text."""
    battery = robot.battery
    if battery is not None and battery.text != before:
        recorder.event("battery", battery.text)
    return battery.text if battery is not None else ""


def _place_at_start(
    robot: Robot, plan: EpisodePlan, recorder: EpisodeRecorder, operator: EpisodeOperator, stop: StopRequests
) -> tuple[Fix, PlacementLook | None]:
    """Bring the robot to its start, with the operator's help if it needs that.

    Returns:
        The robot's pose, and the measurement that it comes from if there was one.
    """
    if not robot.needs_operator:
        with stop.interruptible():
            robot.begin(plan.start, plan.seed)
            return robot.locate(), None
    with stop.interruptible():
        robot.wait_until_ready()
    problem = ""
    placing = Placing(robot, plan.site, plan.start, plan.seed, plan.parameters, stop, lambda: recorder.kept_photo(plan))
    while True:
        operator.place(plan.start, problem, placing)
        try:
            return placing.begin(), placing.last
        except NotPlacedError as error:
            problem = str(error)


def _stop_measurement(
    robot: Robot, plan: EpisodePlan, start: Fix, placed: PlacementLook | None
) -> StopMeasurement | None:
    """Return what measures the pose after STOP; None for a robot whose pose is known, or without a depth camera."""
    if Sensor.DEPTH not in robot.sensors or start.source not in (PoseSource.MEASURED, PoseSource.ESTIMATED):
        return None
    is_measured = start.source is PoseSource.MEASURED and placed is not None and placed.measured is not None
    known = placed.measured.covariance if is_measured and placed and placed.measured else None
    return StopMeasurement(plan.site, plan.goal, plan.parameters, start, known)


def _leg_of(
    robot: Robot, leg: EpisodePlan, start: Pose, spent: Spent, end: EpisodeEnd, before: int, calls: PolicyCalls
) -> SequenceLeg:
    """Return what the record has of a goal of a sequence, which was given at a pose, after `before` other goals."""
    space = free_space(leg.site, robot.identity.profile.base.radius_m)
    shortest_m = space.geodesic_to_goal_m(start, leg.goal, leg.parameters)
    memory = before == 0 or calls.keeps_memory
    return leg_of(before + 1, leg.goal, end.verdict, spent, shortest_m, memory=memory)


def _judged(
    robot: Robot, plan: EpisodePlan, reason: EndReason, actions: int, wall_s: float, error: str, *, began: bool
) -> EpisodeEnd:
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
    proposed = robot.needs_operator or not robot.identity.simulated
    return EpisodeEnd(verdict, actions, final, wall_s, error, proposed, began)
