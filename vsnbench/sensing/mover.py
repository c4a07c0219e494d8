"""Execution of movements by velocities and odometry, without a middleware.

Other threads pass in odometry and events. `drive` returns when the movement has ended. Every exit commands zero
velocity.
"""

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from vsnbench.control.command import STANDSTILL, Command, MotionStatus
from vsnbench.control.controller import MotionController
from vsnbench.control.held_heading import HeldHeading
from vsnbench.control.leg import Leg
from vsnbench.control.legs import LegPlan, controller_of, longest_duration_s, refusal
from vsnbench.control.response import ResponseMeter
from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import is_quiet, noise_words, too_noisy
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.mover_senses import MoverSenses
from vsnbench.sensing.odometry.odometry import ClockOffset, OdometryTracker
from vsnbench.sensing.odometry.rest_readings import ROLL_OUT_S, RestReadings, Start
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import STOP, Drive
from vsnbench.values.pose import Pose

_SETTLING_READINGS = 2.5
"""Settling time in odometry periods: slow odometry repeats its value while the robot still rolls."""
_LONGEST_SETTLING_S = 1.0
_LONGEST_PAUSE_S = 0.6
"""Longest time between two commands: after a longer one, a stopped base would start again without a request."""
_LONGEST_START_S = 1.5
"""Longest time of readings at rest before a movement of a noisy base."""


class Mover:
    """Executes movements one at a time; a new request pre-empts the running one.

    A movement that holds headings turns relative to the last target, not to the heading that the last turn reached.
    After a turn by hand or a reset of the odometry, it turns relative to the present heading.

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
        self.settings = settings
        self._tracker = tracker
        self._now_s = now_s
        self._sleep_until = sleep_until
        self.monotonic_s = monotonic_s
        self._clock = ClockOffset()
        self._senses = MoverSenses()
        self._lock = threading.Lock()
        self._moving = threading.Lock()
        self._ticket = 0
        self._ticket_of = ""
        self._stopped = ""
        """Why no movement may begin any more, or an empty string."""
        self._held = HeldHeading()
        self._odometry_seen_s = -math.inf
        self._periods_s: deque[float] = deque(maxlen=20)
        self._rest = RestReadings()
        self.response = ResponseMeter()
        self._driven: list[tuple[float, Pose]] | None = None
        """Readings since the running movement began."""

    def take_odometry(self, x_m: float, y_m: float, heading_rad: float, stamp_s: float) -> None:
        """Take one odometry message; values that are not finite are faults, and so are jumps."""
        arrival_s = self._now_s()
        with self._lock:
            if self._tracker.latest is not None:
                self._periods_s.append(stamp_s - self._tracker.latest.stamp_s)
            fault = self._tracker.add(x_m, y_m, heading_rad, stamp_s, arrival_s)
            self._odometry_seen_s = self.monotonic_s()
            if fault is not None:
                self._senses.odometry_fault = fault
            if fault is None or not fault.is_dropped:
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
        """End the running movement as failed, let no other begin, and command zero velocity."""
        with self._lock:
            self._stopped = reason
        with self._moving:
            self._send(STANDSTILL)

    def drive(self, movement: Drive, caller_gone: Callable[[], bool], timeout_s: float = math.inf) -> MotionResult:
        """Execute a movement leg by leg, and return whether and why not it was done; the caller measures the motion.

        Args:
            movement: the movement. One that does not hold headings begins with the measured heading.
            caller_gone: returns whether the caller has disconnected, which ends the movement.
            timeout_s: longest duration, if it is shorter than `longest_duration_s`.
        """
        if refused := refusal(movement, self.settings):
            return _failed(refused)
        holds = movement.holds_heading
        if not holds:
            timeout_s = min(timeout_s, longest_duration_s(movement, self.settings))
        ticket = self._take_ticket(f"pre-empted by another movement: {movement.text}")
        with self._moving:
            began_s = self._now_s()

            def end() -> MotionResult | None:
                if ended := self._end_of(ticket):
                    return ended
                if (lasted_s := self._now_s() - began_s) > timeout_s:
                    return _failed(f"not done after {lasted_s:.1f} s")
                return _failed("the caller has disconnected") if caller_gone() else None

            try:
                if not holds:
                    self.forget_heading()
                result = MotionResult(completed=True) if movement == STOP else self._drive(movement, end)
                return replace(result, duration_s=self._now_s() - began_s)
            finally:
                if not holds:
                    self.forget_heading()
                self._send(STANDSTILL)

    def steer(self, step: Callable[[Pose, float, float], Command | None]) -> MotionResult:
        """Command what `step` returns in each control period, until it returns None or the base must stop.

        Args:
            step: takes the odometry, the time and the time of the odometry on the same clock; returns a velocity.
        """
        ticket = self._take_ticket("pre-empted by a path")
        with self._moving:
            with self._lock:
                self._senses.begin()
                if hazard := self._senses.forbidden(backs_off=False):
                    return _failed(hazard)
            last_s = self._now_s()
            try:
                while True:
                    now_s = self._now_s()
                    if now_s - last_s > _LONGEST_PAUSE_S:
                        return _failed(_paused(now_s - last_s))
                    last_s = now_s
                    if ended := self._end_of(ticket):
                        return ended
                    with self._lock:
                        reading = self._tracker.latest
                        stamp_s = 0.0 if reading is None else self._clock.to_local(reading.stamp_s)
                    if reading is None:
                        return _failed("no odometry: check the driver of the base", sensor_lost=True)
                    command = step(reading.pose, now_s, stamp_s)
                    if command is None:
                        return MotionResult(completed=True)
                    if command != STANDSTILL:
                        self.take_other_command()
                    self._send(self.settings.sendable(command))
                    self._sleep_until(now_s + self.settings.control_period_s)
            finally:
                self._send(STANDSTILL)

    def _drive(self, movement: Drive, end: Callable[[], MotionResult | None]) -> MotionResult:
        """Execute the legs of a movement; `end` returns its result if it has to end at once."""
        plan: LegPlan | None = None
        corrections = 0
        while True:
            with self._lock:
                latest = self._tracker.latest
                pose = None if latest is None else self._rest.mean(latest.pose)
            if pose is None:
                return _failed("no odometry: check the driver of the base", sensor_lost=True)
            plan = plan or LegPlan(movement, pose, self.settings)
            leg = plan.next(pose)
            if leg is None:
                return MotionResult(not plan.failure, failure=plan.failure, corrections=corrections)
            result = self._move(leg, end)
            corrections += result.corrections
            if not result.completed:
                return replace(result, corrections=corrections)

    def _take_ticket(self, reason: str) -> int:
        with self._lock:
            self._ticket += 1
            self._ticket_of = reason
            return self._ticket

    def _move(self, leg: Leg, end: Callable[[], MotionResult | None]) -> MotionResult:
        """Execute one leg."""
        settings = leg.settings(self.settings)
        with self._lock:
            self._senses.begin()
            reading = self._tracker.latest
            silent_s = self.monotonic_s() - self._odometry_seen_s
            hazard = self._senses.forbidden(backs_off=leg.backs_off)
        if reading is None or silent_s > settings.odometry_timeout_s:
            what = "no odometry" if reading is None else f"no odometry for {silent_s:.1f} s"
            return _failed(f"{what}: check the driver of the base", sensor_lost=True)
        if hazard:
            return _failed(hazard)
        start = self._await_start(leg, settings, end)
        if isinstance(start, MotionResult):
            return start
        with self._lock:
            self._held.begin(start.error(turns=True))
            held_rad = self._held.start_rad(start.pose.heading_rad) if leg.holds_heading else start.pose.heading_rad
            start_error = self._held.error_rad if leg.turns else start.error(turns=False)
        end_rad = leg.end_rad(held_rad)
        settings = settings.model_copy(update={"settle_s": max(settings.settle_s, self._settling_s())})
        response = self.response.response
        controller = controller_of(leg, start.pose, end_rad, settings, start.noise, start_error, response)
        sensor_lost, ended_by_itself = False, False
        with self._lock:
            self._rest.moves()
            self._driven = []
        commands: list[tuple[float, Command]] = []
        last_s = self._now_s()
        try:
            while controller.status is MotionStatus.MOVING:
                now_s = self._now_s()
                if now_s - last_s > _LONGEST_PAUSE_S:
                    controller.abort(_paused(now_s - last_s))
                    break
                last_s = now_s
                with self._lock:
                    reading = self._tracker.latest or reading
                if ended := end():
                    sensor_lost = ended.sensor_lost
                    controller.abort(ended.failure)
                    break
                command = controller.step(reading.pose, now_s, self._clock.to_local(reading.stamp_s))
                commands.append((now_s, command))
                self._send(settings.sendable(command if response is None else response.scaled(command)))
                self._sleep_until(now_s + settings.control_period_s)
            else:
                ended_by_itself = not controller.sensor_lost
        finally:  # also if `end` raises, which ends the movement
            self._send(STANDSTILL)
            with self._lock:
                driven, self._driven = self._driven or [], None
                if controller.done:
                    self._held.keep(end_rad)
                else:
                    self._held.forget()
                self._rest.rests(min(controller.rest_since_s, self._now_s() + ROLL_OUT_S))
        if isinstance(controller, MotionController) and ended_by_itself:
            slowest, lateral = controller.slowest, leg.is_lateral
            self.response.add(slowest, start.pose, commands, driven, turns=leg.turns, is_lateral=lateral)
        return MotionResult(
            controller.done,
            failure=controller.failure,
            corrections=controller.corrections,
            sensor_lost=sensor_lost or controller.sensor_lost,
        )

    def _await_start(
        self, leg: Leg, settings: MotionSettings, end: Callable[[], MotionResult | None]
    ) -> Start | MotionResult:
        """Return the start of a leg, after the readings at rest that a noisy base needs; or why it has to end."""
        tolerance = settings.tolerance(turns=leg.turns)
        give_up_s = self._now_s() + _LONGEST_START_S
        while True:
            now_s = self._now_s()
            if ended := end():
                return ended
            with self._lock:
                holds = self._held.is_known
                latest = self._tracker.latest
                rate_hz = 1 / statistics.median(self._periods_s) if self._periods_s else 1.0
                assert latest is not None  # noqa: S101  # checked before the leg
                start = self._rest.start(
                    latest.pose,
                    tolerance,
                    turns=leg.turns,
                    holds_heading=holds,
                    heading_tolerance_rad=settings.tolerance(turns=True) if leg.holds_heading and not holds else None,
                    final=now_s >= give_up_s,
                )
            if start is not None:
                break
            self._sleep_until(now_s + settings.control_period_s)
        noise = start.noise.along(turns=leg.turns)
        if not is_quiet(noise, tolerance) and too_noisy(noise, tolerance, settings.aim_share, rate_hz):
            return _failed(noise_words(noise, tolerance, turns=leg.turns))
        return start

    def _end_of(self, ticket: int) -> MotionResult | None:
        """Return the result of the running movement if the base or another movement ends it, or None."""
        with self._lock:
            silent_s = self.monotonic_s() - self._odometry_seen_s
            failure, sensor_lost = self._senses.failure(silent_s, self.settings.odometry_timeout_s)
            preempted = self._stopped or (self._ticket_of if self._ticket != ticket else "")
        return _failed(failure or preempted, sensor_lost=sensor_lost) if failure or preempted else None

    def _settling_s(self) -> float:
        """Return the settling time for the measured period of the odometry."""
        with self._lock:
            period_s = statistics.median(self._periods_s) if self._periods_s else 0.0
        return min(max(_SETTLING_READINGS * period_s, 0.0), _LONGEST_SETTLING_S)


def _paused(pause_s: float) -> str:
    return f"the control loop paused for {pause_s:.1f} s: its machine is overloaded"


def _failed(reason: str, *, sensor_lost: bool = False) -> MotionResult:
    return MotionResult(completed=False, failure=reason, sensor_lost=sensor_lost)
