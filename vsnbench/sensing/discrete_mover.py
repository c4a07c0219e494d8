"""Execution of discrete movements by velocities and odometry, without a middleware.

Other threads pass in odometry and events. `carry_out` returns when the movement has ended. Every exit commands zero
velocity.
"""

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.controller import MotionController
from vsnbench.control.held_heading import HeldHeading
from vsnbench.control.law import heading_after
from vsnbench.control.legs import Leg, LegPlan, longest_duration_s
from vsnbench.control.response import ResponseMeter
from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import is_quiet, noise_words, too_noisy
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.movements import MOVEMENTS, Outcome
from vsnbench.sensing.mover_senses import MoverSenses
from vsnbench.sensing.odometry.odometry import ClockOffset, OdometryFaultKind, OdometryTracker
from vsnbench.sensing.odometry.rest_readings import ROLL_OUT_S, RestReadings, Start
from vsnbench.values.action import Action
from vsnbench.values.movement import Drive, movement_to_json
from vsnbench.values.pose import Pose

_SETTLING_READINGS = 2.5
"""Settling time in odometry periods: slow odometry repeats its value while the robot still rolls."""
_LONGEST_SETTLING_S, _LONGEST_MOVE_M = 1.0, 10.0
_LONGEST_PAUSE_S = 0.6
"""Longest time between two commands: after a longer one, a stopped base would start again without a request."""
_LONGEST_START_S = 1.5
"""Longest time of readings at rest before a movement of a noisy base."""


@dataclass(frozen=True, slots=True)
class _Request:
    """A movement in progress."""

    movement: str
    action: Action
    settings: MotionSettings
    ticket: int
    caller_gone: Callable[[], bool]
    leg: Leg | None = None
    """Leg of a movement with parameters; None for a discrete action."""


class _OverdueError(Exception):
    """A movement has reached its deadline."""


class DiscreteMover:
    """Executes movements one at a time; a new request pre-empts the running one.

    Headings are held absolutely: the target of a turn is relative to the last target, not to the heading that the last
    turn reached. After a turn by hand or a reset of the odometry, it is relative to the present heading.

    Args:
        send: commands a velocity.
        settings: settings of the movements.
        tracker: checks the odometry.
        now_s: time in which motions are measured; simulated where the network's time is simulated.
        sleep_until: waits for a time of `now_s`.
        monotonic_s: real time, by which silent odometry is noticed even if simulated time has stopped.
    """

    def __init__(
        self,
        send: Callable[[Command], None],
        settings: MotionSettings,
        tracker: OdometryTracker,
        now_s: Callable[[], float],
        sleep_until: Callable[[float], None],
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._send = send
        self._settings = settings
        self._tracker = tracker
        self._now_s = now_s
        self._sleep_until = sleep_until
        self._monotonic_s = monotonic_s
        self._clock = ClockOffset()
        self._senses = MoverSenses()
        self._lock = threading.Lock()
        self._moving = threading.Lock()
        self._ticket = 0
        self._ticket_of = ""
        self._held = HeldHeading()
        self._odometry_seen_s = -math.inf
        self._periods_s: deque[float] = deque(maxlen=20)
        self._rest = RestReadings()
        self._response = ResponseMeter()
        self._driven: list[tuple[float, Pose]] | None = None
        """Readings since the running movement began."""

    def take_odometry(self, x_m: float, y_m: float, heading_rad: float, stamp_s: float) -> None:
        """Take one odometry message; values that are not finite are faults, and so are jumps."""
        arrival_s = self._now_s()
        with self._lock:
            if self._tracker.latest is not None:
                self._periods_s.append(stamp_s - self._tracker.latest.stamp_s)
            fault = self._tracker.add(x_m, y_m, heading_rad, stamp_s, arrival_s)
            self._odometry_seen_s = self._monotonic_s()
            if fault is not None:
                self._senses.odometry_fault = fault
            if fault is None or fault.kind is OdometryFaultKind.JUMPED:
                self._clock.add(stamp_s, arrival_s)
            if fault is not None:
                self._rest.forget()
            elif self._tracker.latest is not None:
                reading = self._clock.to_local(stamp_s), self._tracker.latest.pose
                self._rest.add(reading[1], reading[0])
                if self._driven is not None:
                    self._driven.append(reading)

    def take_rival(self, rival: str) -> None:
        """Take that another publisher commanded the base to move: the running movement ends at once."""
        with self._lock:
            self._senses.rival = rival
        self.take_other_command()

    def take_other_command(self) -> None:
        """Take that the base was commanded outside of a movement: it is at rest only some time later."""
        with self._lock:
            self._rest.rests(max(self._rest.from_s, self._now_s() + ROLL_OUT_S))

    def take_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take the state of one hazard sensor."""
        with self._lock:
            self._senses.take_hazard(hazard, sensor, active, where)
            if active and hazard is Hazard.WHEEL_DROP:
                self._held.forget()

    def forget_heading(self) -> None:
        """Start the next movement from the present heading, as at the start of an episode."""
        with self._lock:
            self._held.forget()

    def stop(self, reason: str) -> None:
        """End the running movement as failed, and command zero velocity."""
        self._take_ticket(reason)
        with self._moving:
            self._send(STANDSTILL)

    def carry_out(
        self, movement: str, angle_deg: float, caller_gone: Callable[[], bool], distance_m: float | None = None
    ) -> Outcome:
        """Execute one movement to its end.

        Args:
            movement: a key of MOVEMENTS.
            angle_deg: angle of a turn; 0 for no turn.
            caller_gone: returns whether the caller has disconnected, which ends the movement.
            distance_m: distance of a move; None for the configured one.
        """
        action = MOVEMENTS.get(movement)
        if action is None:
            return Outcome(movement, False, f"unknown movement {movement!r}: use one of {', '.join(MOVEMENTS)}")
        if action.turns and not 0 <= angle_deg <= 360:
            return Outcome(movement, False, f"{movement} {angle_deg}: the angle of a turn must be 0 to 360 degrees")
        settings = self._settings
        if action.turns and angle_deg == 0:
            action = Action.STOP
        elif action.turns:
            settings = settings.model_copy(update={"turn_rad": math.radians(angle_deg)})
        elif distance_m is not None and action.translates:
            if not 0 < distance_m <= _LONGEST_MOVE_M:
                reason = f"{movement} {distance_m:g}: a move must be at most {_LONGEST_MOVE_M:g} m"
                return Outcome(movement, False, reason)
            settings = settings.model_copy(update={"forward_m": distance_m})
        ticket = self._take_ticket(f"pre-empted by {movement}")
        with self._moving:
            try:
                if action is Action.STOP:
                    return Outcome(movement, True)
                return self._move(_Request(movement, action, settings, ticket, caller_gone))
            finally:
                self._send(STANDSTILL)

    def drive(self, movement: Drive, caller_gone: Callable[[], bool], timeout_s: float = math.inf) -> Outcome:
        """Execute a movement with parameters, leg by leg.

        Args:
            movement: the movement.
            caller_gone: see `carry_out`.
            timeout_s: longest duration, if it is shorter than `longest_duration_s`.
        """
        name = movement_to_json(movement)["kind"]
        timeout_s = min(timeout_s, longest_duration_s(movement, self._settings))
        ticket = self._take_ticket(f"pre-empted by {name}")
        with self._moving:
            began_s = self._now_s()

            def is_over() -> bool:
                if self._now_s() - began_s > timeout_s:
                    raise _OverdueError
                return caller_gone()

            corrections = 0
            try:
                self.forget_heading()
                plan: LegPlan | None = None
                while True:
                    with self._lock:
                        latest = self._tracker.latest
                        pose = None if latest is None else self._rest.mean(latest.pose)
                    if pose is None:
                        return Outcome(name, False, "no odometry: check the driver of the base", sensor_lost=True)
                    plan = plan or LegPlan(movement, pose)
                    leg = plan.next(pose)
                    if leg is None:
                        return Outcome(name, not plan.failure, plan.failure, corrections, self._now_s() - began_s)
                    settings = leg.settings(self._settings)
                    outcome = self._move(_Request(name, leg.action, settings, ticket, is_over, leg))
                    corrections += outcome.corrections
                    if not outcome.answer:
                        return replace(outcome, corrections=corrections, duration_s=self._now_s() - began_s)
            except _OverdueError:
                reason = f"not done after {self._now_s() - began_s:.1f} s"
                return Outcome(name, False, reason, corrections, self._now_s() - began_s)
            finally:
                self.forget_heading()
                self._send(STANDSTILL)

    def _take_ticket(self, reason: str) -> int:
        with self._lock:
            self._ticket += 1
            self._ticket_of = reason
            return self._ticket

    def _move(self, request: _Request) -> Outcome:
        movement, action, settings = request.movement, request.action, request.settings
        with self._lock:
            self._senses.begin()
            reading = self._tracker.latest
            silent_s = self._monotonic_s() - self._odometry_seen_s
            hazard = self._senses.forbidden(action)
        if reading is None or silent_s > settings.odometry_timeout_s:
            what = "no odometry" if reading is None else f"no odometry for {silent_s:.1f} s"
            return Outcome(movement, False, f"{what}: check the driver of the base", sensor_lost=True)
        if hazard:
            return Outcome(movement, False, hazard)
        start = self._await_start(request)
        if isinstance(start, Outcome):
            return start
        with self._lock:
            held_rad = self._held.start_rad(start.pose.heading_rad, start.error(turns=True))
            start_error = self._held.error_rad if action.turns else start.error(turns=False)
        target_rad = heading_after(action, held_rad, settings)
        settings = settings.model_copy(update={"settle_s": max(settings.settle_s, self._settling_s())})
        controller: Controller
        response = self._response.response
        if request.leg is not None:
            target_rad = request.leg.target_heading_rad
            controller = request.leg.controller(start.pose, settings, start.noise, start_error, response)
        else:
            controller = MotionController(action, start.pose, target_rad, settings, start.noise, start_error, response)
        sensor_lost, ended_by_itself = False, False
        with self._lock:
            self._rest.moves()
            self._driven = []
        commands: list[tuple[float, Command]] = []
        last_s = self._now_s()
        while controller.status is MotionStatus.MOVING:
            now_s = self._now_s()
            if now_s - last_s > _LONGEST_PAUSE_S:
                controller.abort(f"the control loop paused for {now_s - last_s:.1f} s: its machine is overloaded")
                break
            last_s = now_s
            with self._lock:
                reading = self._tracker.latest or reading
            if failed := self._failure(request):
                sensor_lost = failed.sensor_lost
                controller.abort(failed.reason)
                break
            command = controller.step(reading.pose, now_s, self._clock.to_local(reading.stamp_s))
            commands.append((now_s, command))
            self._send(command if response is None else response.scaled(command))
            self._sleep_until(now_s + settings.control_period_s)
        else:
            ended_by_itself = not controller.sensor_lost
        self._send(STANDSTILL)
        self._learn(controller, start.pose, commands, ended_by_itself=ended_by_itself)
        with self._lock:
            if controller.done:
                self._held.keep(target_rad)
            else:
                self._held.forget()
            self._rest.rests(min(controller.rest_since_s, self._now_s() + ROLL_OUT_S))
        lost = sensor_lost or controller.sensor_lost
        return Outcome(
            movement, controller.done, controller.failure, controller.corrections, controller.duration_s, lost
        )

    def _learn(
        self, controller: Controller, start: Pose, commands: list[tuple[float, Command]], *, ended_by_itself: bool
    ) -> None:
        """Measure the response of the base from a movement that ended by itself."""
        with self._lock:
            driven, self._driven = self._driven or [], None
        if isinstance(controller, MotionController) and ended_by_itself:
            self._response.add(controller.action, controller.slowest, start, commands, driven)

    def _await_start(self, request: _Request) -> Start | Outcome:
        """Return the start of the movement, after the readings at rest that a noisy base needs."""
        action, settings = request.action, request.settings
        tolerance, turns = settings.tolerance(action), action.turns
        give_up_s = self._now_s() + _LONGEST_START_S
        while True:
            now_s = self._now_s()
            if failed := self._failure(request):
                return failed
            with self._lock:
                holds = self._held.is_known
                latest = self._tracker.latest
                rate_hz = 1 / statistics.median(self._periods_s) if self._periods_s else 1.0
                assert latest is not None  # noqa: S101  # checked before the movement
                start = self._rest.start(
                    latest.pose, tolerance, turns=turns, holds_heading=holds, final=now_s >= give_up_s
                )
            if start is not None:
                break
            self._sleep_until(now_s + settings.control_period_s)
        noise = start.noise.along(turns=turns)
        if not is_quiet(noise, tolerance) and too_noisy(noise, tolerance, settings.aim_share, rate_hz):
            return Outcome(request.movement, False, noise_words(noise, tolerance, turns=turns))
        return start

    def _failure(self, request: _Request) -> Outcome | None:
        """Return the outcome of the running movement if it has to end, or None."""
        movement, timeout_s = request.movement, request.settings.odometry_timeout_s
        with self._lock:
            silent_s = self._monotonic_s() - self._odometry_seen_s
            failed = self._senses.failure(movement, silent_s=silent_s, timeout_s=timeout_s)
            preempted = self._ticket_of if self._ticket != request.ticket else ""
        if failed or preempted:
            return failed or Outcome(movement, False, preempted)
        return Outcome(movement, False, "the caller has disconnected") if request.caller_gone() else None

    def _settling_s(self) -> float:
        """Return the settling time for the measured period of the odometry."""
        with self._lock:
            period_s = statistics.median(self._periods_s) if self._periods_s else 0.0
        return min(max(_SETTLING_READINGS * period_s, 0.0), _LONGEST_SETTLING_S)
