"""The steps of an episode in which the robot drives on: while the model thinks, or driven by a stack.

A step is one answer: the observation that it answers, and what was driven from when it took effect until the next
answer did. The first step begins with the capture of its image, so that the durations of the steps are the episode's.
A stack's answers are NOOP while it drives, and STOP.
"""

import time
from dataclasses import dataclass, field, replace

from vsnbench.errors import DecisionError, RobotError
from vsnbench.protocol.execution import KINDS_WHILE_DRIVING, Execution
from vsnbench.protocol.judge import EndReason, end_after
from vsnbench.protocol.limits import Spent, budget_left
from vsnbench.robots.contract import Robot
from vsnbench.runner.disturbances.policy_view import PolicyView
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.runner.episode.pixel import waypoint_of
from vsnbench.runner.episode.policy_calls import PolicyCalls, PolicyFailedError
from vsnbench.runner.episode.step import EpisodePlan, Step, Stepper
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.text.sanitize import error_line
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix
from vsnbench.values.model.card import Anchor
from vsnbench.values.motion_result import NOT_BEGUN, MotionResult
from vsnbench.values.movement import Action, Drive, Pixel, Velocity
from vsnbench.values.observation import Observation
from vsnbench.values.step import AnswerTiming, FilmFrame, StepTimings, taken_action

_NOTHING = MotionResult(completed=True)
_STANDING = Velocity(duration_s=0.05)
"""Brakes, and drops the running path."""
_OVER_LIMIT_S = 0.05
"""Time that a motion may last beyond the time limit, so that the limit is reached despite rounding."""


@dataclass(slots=True, eq=False)
class _Answer:
    """An answer, and the motion since it took effect."""

    observation: Observation
    seen: Observation
    """What the policy saw."""
    decision: Decision
    answered_s: float
    effect_s: float
    """Time at which it takes effect, unless it is stale."""
    timings: StepTimings
    stale: bool = False
    motion: MotionResult = _NOTHING
    frames: list[FilmFrame] = field(default_factory=list)
    """Images that were taken since it took effect."""


class ContinuousStepper(Stepper):
    """Takes the steps of one continuous episode; see `Stepper`.

    In simulation time passes only in `Robot.advance`, also while the model thinks: for the declared latency, or for as
    long as the model took. On a real robot an answer takes effect when it comes, and not before the declared latency.
    """

    def __init__(
        self, robot: Robot, calls: PolicyCalls, view: PolicyView, plan: EpisodePlan, start: Fix, stop: StopRequests
    ) -> None:
        super().__init__(robot, calls, view, plan, start, stop)
        execution = plan.parameters.execution
        self._execution = Execution() if execution is None else execution
        self._running: _Answer | None = None
        """The answer that the robot follows, from when it took effect on."""
        self._next: _Answer | None = None
        """The answer after it, once it has taken effect."""
        self._spent = Spent()
        self._before = start
        is_by_stack = self._execution.is_by_stack  # which may know what is beside the robot by sensors of its own
        self._path_guard = PathGuard(robot.identity.profile, plan.parameters, None if is_by_stack else self._map)
        self._watch = None if is_by_stack and not self._guard.enabled else self._path_guard
        if robot.now_s() is not None:
            stop.at_once = robot.halt
        self._frame_due_s: float | None = None
        """Time of the next frame of the film."""

    def take(self, spent: Spent, before: Fix) -> tuple[Step, EndReason | None]:
        """Take a step from a pose in the site; see `Stepper.take`.

        Raises:
            Stopped: a request to stop. `interrupted` is the step whose motion it ended, if there is one; it also is
                where the model or a sensor ends the episode while the robot drives.
        """
        self._spent, self._before = spent, before
        self._running, self._next = self._next, None
        try:
            with self._stop.interruptible():
                return self._take()
        except BaseException as error:
            self._end_motion(error)
            raise

    def _take(self) -> tuple[Step, EndReason | None]:
        if (running := self._running) is None:  # the robot rests until the first answer
            first = self._ask()
            waited = self._robot.advance(first.effect_s)
            running = self._running = replace(first, motion=waited)
        began_s = time.perf_counter()
        if running.decision.action is Action.STOP and not running.stale:
            self._come_to_rest()
            return self._step(began_s)
        self._start(running)
        thought_s = 0.0
        capture_s = max(running.effect_s, running.observation.stamp_s + 1 / self._execution.max_rate_hz)
        if self._drive_until(capture_s):
            asked_s = time.perf_counter()
            self._next = self._ask()
            thought_s = time.perf_counter() - asked_s
            self._drive_until(self._next.effect_s)
        step, reason = self._step(began_s + thought_s)
        if reason is not None:
            self._come_to_rest()
            return self._step(began_s + thought_s)
        return step, reason

    def _ask(self) -> _Answer:
        """Let the model answer the newest observation."""
        t0 = time.perf_counter()
        observation = self._observe()
        seen = self._view.of(observation)
        t1 = time.perf_counter()
        decision = self._decided(self._calls.act(seen, budget_left(self._so_far(), self._plan.parameters)))
        t2 = time.perf_counter()
        took_s = t2 - t1 if self._execution.latency_s is None else self._execution.latency_s
        effect_s = answered_s = observation.stamp_s + took_s
        if (now_s := self._robot.now_s()) is not None:  # time has passed
            answered_s = now_s
            effect_s = now_s if self._execution.latency_s is None else max(effect_s, now_s)
            took_s = effect_s - observation.stamp_s
        stale = took_s > self._execution.max_answer_age_s and not self._execution.is_by_stack
        timings = StepTimings(t1 - t0, t2 - t1, None)
        return _Answer(observation, seen, decision, answered_s, effect_s, timings, stale=stale)

    def _come_to_rest(self) -> None:
        """Tell the model that the episode has ended, and bring the robot to rest."""
        self._calls.end()
        self._add(self._robot.come_to_rest())

    def _decided(self, decision: Decision) -> Decision:
        """Return a decision that a robot can execute without a stop; a stack's commands go another way.

        Raises:
            PolicyFailedError: it is another one.
        """
        if self._execution.is_by_stack:
            return decision
        if decision.action is Action.STOP or decision.kinds <= KINDS_WHILE_DRIVING:
            return decision
        error = DecisionError(
            f"answered with {decision.action}, which goes from rest to rest: a robot that drives on takes "
            f"{', '.join(sorted(KINDS_WHILE_DRIVING))} and STOP"
        )
        raise PolicyFailedError(f"act: {error_line(error, named=False)}")

    def _start(self, answer: _Answer) -> None:
        """Let the robot follow an answer, unless it is stale, a pixel without depth, or to a side that is not free.

        A side that is not free ends the running path, as an obstacle ahead does: the robot waits for another answer. A
        stack has started the robot itself.
        """
        if answer.stale or self._execution.is_by_stack:
            return
        movement = self._movement(answer)
        if movement is None:
            answer.motion = replace(answer.motion, completed=False, blocked="the pixel has no depth")
            return
        if self._side is not None and (guard := self._side.reading_of(movement)).blocked:
            answer.motion = replace(answer.motion, completed=False, blocked=guard.text)
            self._robot.follow(_STANDING, None)
            return
        anchored = self._calls.anchor is Anchor.CAPTURE
        self._robot.follow(movement, answer.observation.pose if anchored else None)

    def _movement(self, answer: _Answer) -> Drive | None:
        movement = answer.decision.movement
        if isinstance(movement, Pixel):
            return waypoint_of(movement, answer.seen, self._base, self._guard)
        return movement

    def _drive_until(self, time_s: float) -> bool:
        """Drive on until a time; return whether nothing has ended the episode before it."""
        until_s = self._until(time_s)
        return self._film_until(until_s) and self._advance(until_s)

    def _film_until(self, until_s: float) -> bool:
        """Drive on and take the frames that are due before a time; return as `_drive_until` does."""
        running, frames_hz = self._running, self._execution.frames_hz
        if running is None or frames_hz is None:
            return True
        if self._frame_due_s is None:
            self._frame_due_s = self._now_s(running) + 1 / frames_hz
        while self._frame_due_s < until_s:
            if not self._advance(self._frame_due_s):
                return False
            if self._calls.takes_history:
                self._calls.pass_by(self._view.of(self._robot.observe()))
            if (rgb := self._robot.preview()) is not None:
                pose, commanded = self._robot.locate().pose, self._robot.commanded
                running.frames.append(FilmFrame(self._now_s(running), pose, rgb, commanded))
            self._frame_due_s += 1 / frames_hz
        return True

    def _advance(self, until_s: float) -> bool:
        """Drive on until a time; return as `_drive_until` does.

        Raises:
            PolicyFailedError: the depth guard has stopped a robot that a stack drives.
        """
        result = self._robot.advance(until_s, self._watch)
        self._add(result)
        if result.blocked and self._execution.is_by_stack:
            raise PolicyFailedError(f"the depth guard stopped the robot that the stack drove: {result.blocked}")
        limit_s = self._plan.parameters.time_limit_s
        has_time = limit_s is None or self._so_far().time_s < limit_s
        return has_time and result.collision is None and not result.failure

    def _until(self, time_s: float) -> float:
        """Return a time, or that of the limit if it is earlier."""
        limit_s = self._plan.parameters.time_limit_s
        answer = self._running
        if limit_s is None or answer is None:
            return time_s
        return min(time_s, self._began_s(answer) + limit_s - self._spent.time_s + _OVER_LIMIT_S)

    def _began_s(self, running: _Answer) -> float:
        """Return the time from which the motion of an answer counts."""
        return running.observation.stamp_s if self._spent.actions == 0 else running.effect_s

    def _now_s(self, running: _Answer) -> float:
        """Return the time on the robot's clock."""
        return self._began_s(running) + running.motion.duration_s

    def _add(self, result: MotionResult) -> None:
        """Add a part of the motion to that of the running answer."""
        running = self._running
        assert running is not None  # noqa: S101  # set before anything is driven
        running.motion = running.motion.followed_by(result)
        self.watch.moved(result)

    def _so_far(self) -> Spent:
        """Return what the episode has used, including the running answer."""
        if self._running is None:
            return self._spent
        motion = self._running.motion
        return self._spent.after(driving_s=motion.duration_s, thinking_s=0.0, path_m=motion.path_m or 0.0)

    def _step(self, began_s: float) -> tuple[Step, EndReason | None]:
        """Return the step of the running answer, and why the episode ends with it."""
        running = self._running
        assert running is not None  # noqa: S101  # set before anything is driven
        after, motion, reading = self._robot.locate(), running.motion, self._path_guard.last
        until_s = self._now_s(running)
        path_m = max(self._before.pose.distance_to(after.pose), motion.path_m or 0.0)
        spent = self._spent.after(driving_s=motion.duration_s, thinking_s=0.0, path_m=path_m)
        age_s = running.effect_s - running.observation.stamp_s
        timings = replace(running.timings, move_s=time.perf_counter() - began_s)
        step = Step(
            spent.actions,
            running.observation,
            running.decision,
            reading if motion.blocked and reading is not None and reading.blocked else None,
            motion,
            self._before,
            after,
            timings,
            spent,
            refusal=motion.blocked,
            frames=tuple(running.frames),
            answer=AnswerTiming(running.answered_s, age_s, until_s, running.stale),
        )
        if self._next is not None:
            self._next.effect_s = until_s
        action = taken_action(running.decision.action, step.answer)
        return step, end_after(spent, action, motion, self._plan.parameters)

    def _end_motion(self, error: BaseException) -> None:
        """Bring the robot to rest, and keep what it has driven as the last step."""
        if self._running is None:
            self._calls.end()
            return
        try:
            if isinstance(error, Stopped):
                self._robot.halt()
                self._add(self._robot.interrupted_motion() or NOT_BEGUN)
            self._come_to_rest()
            step, _ = self._step(time.perf_counter())
        except RobotError:
            self._robot.halt()
            return
        if isinstance(error, Stopped) and step.result is not None:
            failure = error.request.description
            step = replace(step, result=replace(step.result, completed=False, failure=failure))
        self.interrupted = step
