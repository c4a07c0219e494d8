"""One discrete movement after the other on a base that is driven by velocities and reports odometry.

What the discrete_move node does, without ROS: it is fed odometry and events by other threads, and `carry_out` blocks
until the movement is over. Zero velocity is commanded on every way out.
"""

import logging
import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from vsnbench.motion.controller import STANDSTILL, Command, MotionController, MotionStatus
from vsnbench.motion.law import heading_after, ideal_duration_s, turn_error_rad
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.sensing.odometry import ClockOffset, OdometryFault, OdometryFaultKind, OdometryReading, OdometryTracker

logger = logging.getLogger(__name__)

MOVEMENTS = {
    "Forward": Action.MOVE_FORWARD,
    "Backward": Action.MOVE_BACKWARD,
    "Left": Action.TURN_LEFT,
    "Right": Action.TURN_RIGHT,
    "Stop": Action.STOP,
}
"""The words of the service (paper, Section 3.1.3)."""
_MOVED_BY_HAND_RAD = math.radians(3)
"""A heading farther off the held one than this was turned by somebody else: picked up, pushed, reset."""

_SETTLING_READINGS = 2.5
"""Two fresh readings and some: a slow odometer repeats itself while the robot still rolls."""
_LONGEST_SETTLING_S = 1.0
_LONGEST_MOVE_M = 10.0


class Hazard(StrEnum):
    """What a base's own sensors can report."""

    BUMPER = "bumper"
    CLIFF = "cliff"
    WHEEL_DROP = "wheel drop"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a requested movement."""

    movement: str
    answer: bool
    """What the service answers."""
    reason: str = ""
    """Why the answer is False."""
    corrections: int = 0
    duration_s: float = 0.0
    ideal_s: float = 0.0
    sensor_lost: bool = False


@dataclass
class _Senses:
    """What other threads have reported; guarded by the mover's lock."""

    hazards: dict[Hazard, set[int]] = field(default_factory=lambda: {hazard: set() for hazard in Hazard})
    hazard_reason: str = ""
    """What has happened since the movement began; empty while nothing has."""
    odometry_fault: OdometryFault | None = None


class DiscreteMover:
    """Carries out movements one at a time; a new request pre-empts the one that runs.

    Headings are held absolutely: the target of a turn is reckoned from the last target, not from where the last turn
    happened to end. A robot that was turned by hand, or whose odometry was reset, starts afresh from where it is.
    """

    def __init__(
        self,
        send: Callable[[Command], None],
        settings: MotionSettings,
        tracker: OdometryTracker,
        now_s: Callable[[], float],
        sleep_until: Callable[[float], None],
    ) -> None:
        self._send = send
        self._settings = settings
        self._tracker = tracker
        self._now_s = now_s
        self._sleep_until = sleep_until
        self._clock = ClockOffset()
        self._senses = _Senses()
        self._lock = threading.Lock()
        self._moving = threading.Lock()
        self._ticket = 0
        self._ticket_of = ""
        self._held_heading_rad: float | None = None
        self._odometry_seen_s = -math.inf
        self._periods_s: deque[float] = deque(maxlen=20)

    def take_odometry(self, x_m: float, y_m: float, heading_rad: float, stamp_s: float) -> None:
        """Take one odometry message; a heading or position that is no number is a fault, and so is a jump."""
        arrival_s = self._now_s()
        with self._lock:
            if self._tracker.latest is not None:
                self._periods_s.append(stamp_s - self._tracker.latest.stamp_s)
            fault = self._tracker.add(x_m, y_m, heading_rad, stamp_s, arrival_s)
            self._odometry_seen_s = time.monotonic()
            if fault is not None:
                self._senses.odometry_fault = fault
            if fault is None or fault.kind is OdometryFaultKind.JUMPED:
                self._clock.add(stamp_s, arrival_s)

    def take_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take an event of the base: one sensor's state changed."""
        with self._lock:
            if not active:
                self._senses.hazards[hazard].discard(sensor)
                return
            self._senses.hazards[hazard].add(sensor)
            self._senses.hazard_reason = f"{hazard.value} ({where})"
            if hazard is Hazard.WHEEL_DROP:
                self._held_heading_rad = None

    def forget_heading(self) -> None:
        """The next movement starts from the heading that the robot then has: a new episode."""
        with self._lock:
            self._held_heading_rad = None

    def stop(self, reason: str) -> None:
        """End the movement that runs, if any, as failed, and stand still."""
        self._take_ticket(reason)
        with self._moving:
            self._send(STANDSTILL)

    def carry_out(
        self, movement: str, angle_deg: int, caller_gone: Callable[[], bool], distance_m: float | None = None
    ) -> Outcome:
        """Carry out one movement to its end.

        Args:
            movement: a word of MOVEMENTS.
            angle_deg: of a turn; 0 turns nothing.
            caller_gone: whether the one who asked is no longer there; nobody drives on for a dead caller.
            distance_m: of a move; as configured when left out.
        """
        action = MOVEMENTS.get(movement)
        if action is None:
            return Outcome(movement, False, f"unknown movement {movement!r}: it is one of {', '.join(MOVEMENTS)}")
        if action.turns and not 0 <= angle_deg <= 360:
            return Outcome(movement, False, f"{movement} {angle_deg}: the angle of a turn is 0 to 360 degrees")
        settings = self._settings
        if action.turns and angle_deg == 0:
            action = Action.STOP
        elif action.turns:
            settings = settings.model_copy(update={"turn_rad": math.radians(angle_deg)})
        elif distance_m is not None and action.translates:
            if not 0 < distance_m <= _LONGEST_MOVE_M:
                return Outcome(
                    movement, False, f"{movement} {distance_m:g}: a move is up to {_LONGEST_MOVE_M:g} m long"
                )
            settings = settings.model_copy(update={"forward_m": distance_m})
        ticket = self._take_ticket(f"pre-empted by {movement}")
        with self._moving:
            try:
                if action is Action.STOP:
                    return Outcome(movement, True)
                return self._move(movement, action, settings, ticket, caller_gone)
            finally:
                self._send(STANDSTILL)

    def _take_ticket(self, reason: str) -> int:
        with self._lock:
            self._ticket += 1
            self._ticket_of = reason
            return self._ticket

    def _move(
        self, movement: str, action: Action, settings: MotionSettings, ticket: int, caller_gone: Callable[[], bool]
    ) -> Outcome:
        with self._lock:
            self._senses.hazard_reason, self._senses.odometry_fault = "", None
            reading = self._tracker.latest
            silent_s = time.monotonic() - self._odometry_seen_s
            standing = self._standing_hazard(action)
        if reading is None or silent_s > settings.odometry_timeout_s:
            what = "no odometry at all" if reading is None else f"no odometry for {silent_s:.1f} s"
            return Outcome(movement, False, f"{what}: is the base's driver running?", sensor_lost=True)
        if standing:
            return Outcome(movement, False, standing)
        held_rad = self._heading_to_hold(reading)
        target_rad = heading_after(action, held_rad, settings)
        settings = settings.model_copy(update={"settle_s": max(settings.settle_s, self._settling_s())})
        controller = MotionController(action, reading.pose, target_rad, settings)
        ideal_s = ideal_duration_s(action, settings)
        sensor_lost = False
        while controller.status is MotionStatus.MOVING:
            now_s = self._now_s()
            with self._lock:
                reading = self._tracker.latest or reading
                fault, hazard = self._senses.odometry_fault, self._senses.hazard_reason
                preempted = self._ticket_of if self._ticket != ticket else ""
                silent_s = time.monotonic() - self._odometry_seen_s
            lost = fault.words if fault else ""
            if silent_s > settings.odometry_timeout_s:
                lost = f"no odometry for {silent_s:.1f} s"
            if reason := hazard or lost or preempted or ("the caller went away" if caller_gone() else ""):
                sensor_lost = bool(lost) and not hazard
                controller.abort(reason)
                break
            self._send(controller.step(reading.pose, now_s, self._clock.to_local(reading.stamp_s)))
            self._sleep_until(now_s + settings.control_period_s)
        self._send(STANDSTILL)
        with self._lock:
            self._held_heading_rad = target_rad if controller.done else None
        return Outcome(
            movement,
            controller.done,
            controller.failure,
            controller.corrections,
            controller.duration_s,
            ideal_s,
            sensor_lost or controller.sensor_lost,
        )

    def _standing_hazard(self, action: Action) -> str:
        """Return why the robot must not move now; backing off a bumper or a cliff is allowed."""
        active = self._senses.hazards
        if active[Hazard.WHEEL_DROP]:
            return "a wheel hangs in the air: put the robot down"
        for hazard in (Hazard.BUMPER, Hazard.CLIFF):
            if active[hazard] and action is not Action.MOVE_BACKWARD:
                return f"the {hazard.value} sensor is still active: free the robot first, Backward is allowed"
        return ""

    def _settling_s(self) -> float:
        """Return how long the pose must not change, seen through odometry as rare as it really comes."""
        with self._lock:
            period_s = statistics.median(self._periods_s) if self._periods_s else 0.0
        return min(max(_SETTLING_READINGS * period_s, 0.0), _LONGEST_SETTLING_S)

    def _heading_to_hold(self, reading: OdometryReading) -> float:
        """Return the heading from which this movement is reckoned, in the unwrapped frame of the odometry."""
        measured_rad = reading.pose.heading_rad
        with self._lock:
            held_rad = self._held_heading_rad
        if held_rad is None:
            return measured_rad
        off_rad = turn_error_rad(held_rad, measured_rad)
        if abs(off_rad) > _MOVED_BY_HAND_RAD:
            logger.warning("turned by %.1f° since the last movement: starting afresh", math.degrees(-off_rad))
            return measured_rad
        return measured_rad + off_rad
