"""One step of an episode: observe, decide, guard, execute."""

import math
import time
from collections import deque
from dataclasses import dataclass, replace

from vsnbench.errors import RobotError
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.judge import EndReason, end_after
from vsnbench.protocol.limits import Spent, budget_left
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.runner.disturbances.policy_view import PolicyView
from vsnbench.runner.episode.camera_watch import CameraWatch
from vsnbench.runner.episode.depth_guard import GuardReading, look_ahead
from vsnbench.runner.episode.local_map import LocalMap
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.runner.episode.pixel import waypoint_of
from vsnbench.runner.episode.policy_calls import PolicyCalls
from vsnbench.runner.episode.side_guard import SideGuard
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.fix import Fix
from vsnbench.values.motion_result import NOT_BEGUN, MotionResult
from vsnbench.values.movement import Action, Pixel
from vsnbench.values.observation import Budget, Observation
from vsnbench.values.step import AnswerTiming, FilmFrame, StepTimings, lasted_s


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One action of the policy, with the observation before it and the measured result."""

    index: int
    """1 for the first action."""
    observation: Observation
    decision: Decision
    guard: GuardReading | None
    """Reading of the depth guard; None for actions that it does not check."""
    result: MotionResult | None
    """None if the guard refused the action before it began."""
    site_before: Fix
    """Pose in the site before the action."""
    site_after: Fix
    """Pose in the site after it; odometry is in `result`."""
    timings: StepTimings
    spent: Spent
    """What the episode has used, including this action; in a sequence, since the goal was given."""
    part: tuple[int, int] | None = None
    """Number from 1 and count, for a part of a chunk."""
    refusal: str = ""
    """Why the action was refused or ended early, or an empty string."""
    answer: AnswerTiming | None = None
    """In continuous execution, when the answer took effect."""
    frames: tuple[FilmFrame, ...] = ()
    """In continuous execution, images that were taken until the next answer took effect."""

    @property
    def ended_s(self) -> float:
        """Time of the end of its motion on the robot's clock."""
        stamp_s = self.observation.stamp_s
        return stamp_s + lasted_s(stamp_s, self.result, self.answer)

    @property
    def blocked(self) -> bool:
        """Whether the action was refused or ended early by the guard; it still counts."""
        return bool(self.refusal)


@dataclass(frozen=True, slots=True)
class EpisodePlan:
    """Goal, start, seed and rules of one episode."""

    site: Site
    goal: str
    start: StartingPosition
    seed: int
    parameters: ProtocolParameters
    disturbances: Disturbances = NONE
    """Of what the policy sees."""


class Stepper:
    """Takes the steps of one episode.

    The parts of a chunk are steps of their own, each with a new observation. When one of them is blocked, the rest of
    the chunk is dropped, and the model decides again.
    """

    def __init__(
        self, robot: Robot, calls: PolicyCalls, view: PolicyView, plan: EpisodePlan, start: Fix, stop: StopRequests
    ) -> None:
        self.interrupted: Step | None = None
        """The step whose motion a request to stop has interrupted."""
        self._stop = stop
        self._moves = False
        self._robot = robot
        self._view = view
        self._calls = calls
        self._plan = plan
        self._base = base = robot.identity.profile.base
        self._guard = plan.parameters.depth_guard
        self.watch = CameraWatch(
            robot.identity,
            self._guard,
            # Without a reference to this object, whose cycle would keep the last images in memory.
            free_ahead_m=lambda: free_space(plan.site, base.radius_m).free_ahead_m(start.pose),
        )
        self._map: LocalMap | None = None
        self._side: SideGuard | None = None
        if base.max_lateral_m_s or plan.parameters.execution is not None:
            self._map = LocalMap(robot.identity.profile, self._guard)
        if base.max_lateral_m_s and self._map is not None:
            self._side = SideGuard(base, plan.parameters, self._map)
        self._parts: deque[tuple[Decision, tuple[int, int]]] = deque()
        self._taken = 0

    def begin_leg(self) -> None:
        """Drop what is left of a chunk: the next answer is for the next goal of a sequence."""
        self._parts.clear()

    def take(self, spent: Spent, before: Fix) -> tuple[Step, EndReason | None]:
        """Take a step from a pose in the site; return it, and the reason of the episode's end if it is the last.

        Raises:
            Stopped: a request to stop. `interrupted` is the step whose motion it ended, halfway, if there is one.
        """
        with self._stop.interruptible():
            t0 = time.perf_counter()
            observation = self._observe()
            seen = self._view.of(observation)
            t1 = time.perf_counter()
            delay_s = 0.0 if self._parts else self._view.latency_s
            decision, part = self._decide(seen, budget_left(spent, self._plan.parameters))
            if delay_s and not self._robot.identity.simulated:
                time.sleep(delay_s)
            t2 = time.perf_counter()
        self._moves, ended = False, None  # from here on, no request may lose a motion that has begun
        try:
            with self._stop.interruptible():
                guard, result, refusal = self._execute(decision, observation, seen)
                after = before
                if result is not None and decision.action is not Action.NOOP:
                    self.watch.moved(result)
                    after = self._robot.locate()
        except Stopped as stopped:
            motion = self._interrupted_motion(stopped, before, t2) if self._moves else None
            if motion is None:
                raise
            (result, after), guard, refusal, ended = motion, None, "", stopped
        if refusal:
            self._parts.clear()
        timings = StepTimings(t1 - t0, t2 - t1, time.perf_counter() - t2)
        path_m = before.pose.distance_to(after.pose)
        spent = spent.after(
            driving_s=result.duration_s if result is not None else 0.0,
            thinking_s=delay_s if self._robot.identity.simulated else t2 - t1,
            path_m=path_m if result is None or result.path_m is None else max(path_m, result.path_m),
        )
        self._taken += 1  # `spent` begins again at each goal of a sequence
        step = Step(self._taken, observation, decision, guard, result, before, after, timings, spent, part, refusal)
        if ended is not None:
            self.interrupted = step
            raise ended
        return step, end_after(spent, decision.action, result, self._plan.parameters)

    def _observe(self) -> Observation:
        """Return a new observation, which the camera watch and the local map have taken."""
        observation = self._robot.observe()
        self.watch.look(observation)
        if self._map is not None:
            self._map.observe(observation)
        return observation

    def _interrupted_motion(self, stopped: Stopped, before: Fix, began_s: float) -> tuple[MotionResult, Fix] | None:
        """Halt the robot, and return its motion so far and its pose; None if there is none, or if it is not known."""
        self._robot.halt()
        try:
            result, after = self._robot.interrupted_motion(), self._robot.locate()
        except RobotError:
            return None
        if result == NOT_BEGUN or (result is None and after.pose == before.pose):
            return None
        if result is None:
            unknown, duration_s = math.nan, time.perf_counter() - began_s
            result = MotionResult(False, displacement_m=unknown, turn_rad=unknown, duration_s=duration_s)
        return replace(result, failure=stopped.request.description), after

    def _decide(self, observation: Observation, budget: Budget) -> tuple[Decision, tuple[int, int] | None]:
        """Return the next part of the running chunk, or ask the model."""
        if self._parts:
            self._calls.pass_by(observation)
            return self._parts.popleft()
        decision = self._calls.act(observation, budget)
        if not decision.parts:
            return decision, None
        count = len(decision.parts)
        for number, part in enumerate(decision.parts, start=1):
            diagnostics = decision.diagnostics if number == 1 else Diagnostics()
            single = replace(self._calls.without_tilt(part), diagnostics=diagnostics)
            self._parts.append((single, (number, count)))
        return self._parts.popleft()

    def _execute(
        self, decision: Decision, observation: Observation, seen: Observation
    ) -> tuple[GuardReading | None, MotionResult | None, str]:
        """Return the guard's reading, the result, and why the action was refused or ended early.

        A pixel refers to the image that the policy has seen.
        """
        if decision.action is Action.NOOP:
            return None, MotionResult(completed=True), ""
        if decision.movement is None:
            guard = None
            if decision.action is Action.MOVE_FORWARD:
                guard = look_ahead(observation, self._base, self._guard)
                if guard.blocked:
                    return guard, None, guard.text
            self._moves = decision.action.moves
            result = self._robot.drive(self._plan.parameters.movement_of(decision.action))
            return guard, result, result.blocked  # a robot's own obstacle avoidance
        movement = decision.movement
        if isinstance(movement, Pixel):
            waypoint = waypoint_of(movement, seen, self._base, self._guard)
            if waypoint is None:
                return None, None, "the pixel has no depth"
            movement = waypoint
        if self._side is not None and movement.goes_sideways:
            guard = self._side.reading_of(movement)
            if guard.blocked:
                return guard, None, guard.text
        watch = PathGuard(self._robot.identity.profile, self._plan.parameters)
        self._moves = True
        result = self._robot.drive(movement, watch)
        return watch.last if result.blocked else None, result, result.blocked
