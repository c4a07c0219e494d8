"""Runs paths that replace each other over ROS: a thread watches the robot while the model thinks.

The thread repeats the newest order (`PathOrder`) to what steers the base, looks at each new depth image, and stops the
base for what also ends a movement: hazards, lost odometry, other publishers, a server that hangs. When this process
ends, nothing repeats the order, and the base stops by itself. A stack that drives the robot gets no orders: the
thread only watches, with the depth guard if it is on, and holds the base at zero velocity once the episode has ended.
"""

import logging
import math
import threading
import time
import uuid
from contextlib import suppress
from dataclasses import replace

from vsnbench.robots.ros.image_timing import odometry_time_s, silent_camera
from vsnbench.robots.ros.movement_runner import MovementRunner
from vsnbench.robots.ros.path_looks import PathLooks
from vsnbench.robots.ros.start import present
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.movement_check import MovementAlarmError
from vsnbench.sensing.odometry.odometry import pose_at
from vsnbench.sensing.path_orders import REPEAT_S, PathEnd, PathOrder, PathState
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.text.sanitize import error_line
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)

_PERIOD_S = 0.02
_LONGEST_BRAKING_S = 3.0
_SIGHT_TIMEOUT_S = 1.0
"""Longest wait for an image of the way ahead before the robot leaves its position."""
_ODOMETRY_WAIT_S = 0.1
"""Longest wait for the odometry at the capture of an image, which may arrive after it."""


class PathRunner:
    """Runs the paths of one robot; every exit leaves it at rest.

    Motion is measured without gaps: a result begins where the one before it ended.
    """

    def __init__(self, link: RobotLink, movements: MovementRunner) -> None:
        self._link = link
        self._movements = movements
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._caller = ""
        self._order: PathOrder | None = None
        self._looks: PathLooks | None = None
        self.begin()

    def begin(self) -> None:
        """Forget the last episode."""
        self.measures = False
        """Whether the robot has driven on in this episode."""
        self._next: tuple[Drive, Pose | None] | None = None
        """Movement and origin for the next call of `advance`, which says how the way is watched."""
        self._start: Pose | None = None
        self._start_s = self._measured_s = self._clock_s = -math.inf
        self._read_s = -math.inf
        """Time of the newest odometry in the measured path."""
        self._last = Pose(0.0, 0.0)
        self._order = None
        self._over = False
        """Whether no path may be driven any more in this episode."""
        self._forget()

    def _forget(self) -> None:
        self._path_m = self._waiting_s = 0.0
        self._blocked = self._failure = ""
        self._sensor_lost = False

    @property
    def now_s(self) -> float:
        """Time on the robot's clock, which does not go back."""
        now_s = odometry_time_s(self._link.snapshot(), time.monotonic())
        if math.isfinite(now_s):
            self._clock_s = max(self._clock_s, now_s)
        return self._clock_s

    def captured_at(self, stamp_s: float) -> Pose:
        """Return the odometry at the capture of an image, relative to the start of the episode.

        The first image of an episode begins the measured motion.
        """
        self._link.wait_for(lambda now: now.latest is not None and now.latest.stamp_s >= stamp_s, _ODOMETRY_WAIT_S)
        now = self._movements.fresh()
        pose = pose_at(now.readings, stamp_s)
        if not self.measures and now.latest is not None:
            with self._lock:
                self._start = self._last = now.latest.pose
                self._start_s = self._measured_s = stamp_s
                self._read_s = now.latest.stamp_s
        return self._movements.relative(now) if pose is None else pose.relative_to(self._movements.origin)

    def follow(self, movement: Drive, anchor: Pose | None) -> None:
        """Replace the running path; it begins with the next call of `advance`."""
        self._next = movement, None if anchor is None else self._movements.origin.compose(anchor)

    def advance(self, until_s: float, looks: PathLooks | None) -> MotionResult:
        """Drive on until a time on the robot's clock, and return the motion since the last result.

        Args:
            until_s: the time.
            looks: checks the way ahead from now on; None without a guard.
        """
        if looks is not None and looks is not self._looks and self._order is None:
            with suppress(MovementAlarmError):  # the first look says it
                looks.load(self._link.snapshot())  # not in the thread that repeats the order
        self._looks = looks
        self._run()
        if self._next is not None and not self._over:
            (movement, origin), self._next = self._next, None
            self._give(movement, origin)
        while not self._ends and (left_s := until_s - self.now_s) > 0:
            time.sleep(min(left_s, _PERIOD_S / 2))
        return self.taken()

    @property
    def _ends(self) -> bool:
        """Whether the motion has ended: a model that is blocked may answer with another path, a stack may not."""
        return bool(self._failure or (self._blocked and self._link.others_drive))

    def come_to_rest(self) -> MotionResult:
        """Brake, and return the motion since the last result once the robot is at rest."""
        self._next = None
        if self._link.others_drive:
            self._movements.force_standstill()
        elif self._thread is not None and not self._over:
            order = self._give(PathEnd.BRAKE)
            give_up_s = time.monotonic() + _LONGEST_BRAKING_S
            while not (self._over or self._rests(order)) and time.monotonic() < give_up_s:
                time.sleep(_PERIOD_S / 2)
            if not self._over and not self._rests(order):
                self._movements.force_standstill()
        if self._over and not self._link.others_drive:
            self._movements.force_standstill()
        self._release()
        self._movements.end = present(self._link.snapshot())
        self._waiting_s = 0.0
        return self.taken()

    def _rests(self, order: PathOrder) -> bool:
        state = self._link.path_state
        return self._is_taken(order, state) and state.waits and self._movements.at_rest(self._link.snapshot())

    def halt(self) -> None:
        """Command zero velocity at once, and drive no path any more; from any thread."""
        with self._lock:
            drives, self._next = self._thread is not None, None
            if drives:
                self._over = True
                self._link.hold_still()
        if drives:
            self._release()
            self._movements.force_standstill()

    def taken(self) -> MotionResult:
        """Return the motion since the last result, and begin the next."""
        with self._lock:
            now = self._link.snapshot()
            self._measure(now)
            latest = self._last if now.latest is None else now.latest.pose
            start = latest if self._start is None else self._start
            end_s = max(self._measured_s, self._start_s)
            collision = self._movements.collision()
            result = MotionResult(
                completed=not self._failure and not self._blocked and collision is None,
                displacement_m=start.distance_to(latest),
                turn_rad=latest.heading_rad - start.heading_rad,
                duration_s=end_s - self._start_s if math.isfinite(self._start_s) else 0.0,
                collision=collision,
                failure=self._failure,
                pose=latest.relative_to(self._movements.origin),
                path_m=self._path_m,
                blocked="" if self._failure else self._blocked,
                sensor_lost=self._sensor_lost,
                waiting_s=self._waiting_s,
            )
            self._start, self._start_s = latest, end_s
            self._forget()
        return result

    def _run(self) -> None:
        """Start the thread, unless it runs or something has ended the motion."""
        if self._thread is not None or self._over:
            return
        self._movements.begin_to_watch()
        self._caller, self._order, self._ended = uuid.uuid4().hex, None, threading.Event()
        self._asks, self._asked_s, self._asked_at_s = 0, 0.0, 0.0
        self._sent_s = -math.inf
        with self._lock:
            self._measure(self._link.snapshot())  # it has waited for the first answer
        self.measures = True
        self._thread = threading.Thread(target=self._watch, args=(self._ended,), name="driving on", daemon=True)
        self._thread.start()

    def _release(self) -> None:
        """End the thread; the base is steered no longer."""
        with self._lock:
            thread, self._thread = self._thread, None
            if thread is None:
                return
            self._ended.set()
        self._give(PathEnd.RELEASE)
        if thread is not threading.current_thread():
            thread.join(_SIGHT_TIMEOUT_S)

    def _give(self, task: Drive | PathEnd, origin: Pose | None = None) -> PathOrder:
        """Give a new order."""
        with self._lock:
            before = self._order
            number, leaves = (0, 0) if before is None else (before.number + 1, before.leaves)
            self._order = order = PathOrder(self._caller, number, task, origin, leaves)
        self._send()
        return order

    def _send(self) -> None:
        if (order := self._order) is not None:
            self._sent_s = time.monotonic()
            self._link.order_path(order)

    def _is_taken(self, order: PathOrder, state: PathState) -> bool:
        return state.caller == order.caller and state.number >= order.number

    def _watch(self, ended: threading.Event) -> None:
        """Watch the robot until the motion is over."""
        while not self._over and not ended.wait(_PERIOD_S):
            self.look_once()

    def look_once(self) -> None:
        """Check the newest reports, stop the base if it has to stop, and repeat the order."""
        try:
            self._check()
        except MovementAlarmError as alarm:
            self._act_on(alarm)
        except Exception as error:  # nothing may leave the base without its watch
            logger.exception("the watch of a robot that drives on failed")
            self._act_on(MovementAlarmError(error_line(error)))
        if not self._over and time.monotonic() - self._sent_s >= REPEAT_S:
            self._send()

    def _check(self) -> None:
        """Measure the motion and check the newest reports.

        Raises:
            MovementAlarmError: the robot has to stop.
        """
        now, state, order = self._link.snapshot(), self._link.path_state, self._order
        with self._lock:
            self._measure(now)
        self._movements.require_no_alarm(now)
        if lost := silent_camera(self._link.names, now, time.monotonic()):
            raise MovementAlarmError(str(lost), sensor_lost=True)
        if order is None:
            if self._looks is not None and self._link.others_drive:
                self._looks.look(now, math.inf)
            return
        if state.failure and self._is_taken(order, state):
            raise MovementAlarmError(state.failure, sensor_lost=state.sensor_lost)
        self._movements.require_steered(now)
        if isinstance(order.task, PathEnd) or not self._is_taken(order, state):
            left_m = math.inf
        else:
            left_m = math.inf if state.remaining_m is None else state.remaining_m
            self._let_leave(order, state, now, left_m)
        if self._looks is not None and not isinstance(order.task, PathEnd):
            self._looks.look(now, left_m)

    def _let_leave(self, order: PathOrder, state: PathState, now: RobotSnapshot, left_m: float) -> None:
        """Allow a robot at rest to leave its position, after a look ahead.

        Raises:
            MovementAlarmError: the way ahead is not free, or not seen.
        """
        if state.asks <= order.leaves:
            return
        if state.asks != self._asks:
            self._asks, self._asked_s, self._asked_at_s = state.asks, self.now_s, time.monotonic()
        if self._looks is not None and not self._looks.look_from_rest(now, self._asked_s, left_m):
            if time.monotonic() - self._asked_at_s > _SIGHT_TIMEOUT_S:
                raise MovementAlarmError(f"no depth image for {_SIGHT_TIMEOUT_S:.1f} s", blocked=True)
            return
        with self._lock:
            if self._order is order:
                self._order = replace(order, leaves=state.asks)
        self._send()

    def _act_on(self, alarm: MovementAlarmError) -> None:
        """Stop the base, and keep why; only a blocked way lets another path begin, and none of a stack."""
        with self._lock:
            if alarm.blocked:
                self._blocked = self._blocked or str(alarm)
            else:
                self._failure, self._sensor_lost = str(alarm), alarm.sensor_lost
            if self._ends:
                self._over = True
                self._link.hold_still()
        self._give(PathEnd.STOP)

    def _measure(self, now: RobotSnapshot) -> None:
        """Add the odometry since the last call to the path, and the time to that of waiting."""
        if now.latest is None or not math.isfinite(self._start_s):
            return
        before_s, self._measured_s = self._measured_s, max(self.now_s, self._measured_s)
        for reading in now.readings:
            if reading.stamp_s > self._read_s:
                self._path_m += self._last.distance_to(reading.pose)
                self._last, self._read_s = reading.pose, reading.stamp_s
        order, state = self._order, self._link.path_state
        if self._link.others_drive:
            return
        if order is None or (self._is_taken(order, state) and state.waits):
            self._waiting_s += self._measured_s - before_s
