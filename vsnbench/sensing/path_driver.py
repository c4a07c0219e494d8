"""Drives a base along paths that replace each other, for a caller that repeats its newest order.

It runs where the base is steered: in the process of the workstation, or in the node next to the base. The base stops
by itself when the caller falls silent, and a path that it had then is not driven to its end later.
"""

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import replace

from vsnbench.control.command import Command
from vsnbench.control.paths.path_follower import PathFollower
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.path_orders import SILENT_S, PathEnd, PathOrder, PathState
from vsnbench.text.sanitize import error_line
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)


def in_thread(run: Callable[[], None]) -> None:
    """Run a function in a thread of its own."""
    threading.Thread(target=run, name="paths", daemon=True).start()


class PathDriver:
    """Executes the orders of one caller at a time; thread-safe.

    A failure ends all orders of its caller: only another caller, which is the next episode, can drive again.

    Args:
        mover: sends the commands, and knows odometry and hazards.
        start: runs the control loop, in a thread of its own.
    """

    def __init__(self, mover: Mover, start: Callable[[Callable[[], None]], None] = in_thread) -> None:
        self._mover = mover
        self._start = start
        self._lock = threading.Lock()
        self._order: PathOrder | None = None
        self._taken = -1
        """Number of the newest order that the control loop has executed."""
        self._heard_s = -math.inf
        self._runs = False
        self._follower = PathFollower(mover.settings)
        self._asking = False
        self._state = PathState()

    @property
    def state(self) -> PathState:
        """The present state."""
        return self._state

    def take(self, order: PathOrder) -> PathState:
        """Take an order or its repetition, and return the present state."""
        with self._lock:
            known = self._order
            is_other = known is None or order.caller != known.caller
            if is_other and self._runs:
                return self._state  # the former caller ends, or falls silent
            self._heard_s = self._mover.monotonic_s()
            if is_other:
                self._taken, self._state = -1, PathState(order.caller, order.number)
            if is_other or known is None or order.number >= known.number:
                self._order = order
            is_new = order.number > self._taken
            starts = is_new and not self._runs and not self._state.failure and not isinstance(order.task, PathEnd)
            if not self._runs and not starts:  # at rest
                self._state = replace(self._state, number=max(order.number, self._state.number), waits=True)
            if starts:
                self._runs = True
                self._follower, self._asking = PathFollower(self._mover.settings, self._mover.response.response), False
                self._state = replace(self._state, number=self._taken, waits=False, asks=self._state.asks)
        if starts:
            self._start(self._run)
        return self._state

    def _run(self) -> None:
        """Execute orders until one releases the base, or something ends them."""
        failure, sensor_lost = "the base is not steered any more", False
        try:
            result = self._mover.steer(self._step)
            failure, sensor_lost = result.failure, result.sensor_lost
        except Exception as error:
            failure = error_line(error)
            logger.exception("the control loop of paths failed")
        finally:
            with self._lock:
                self._runs = False
                failure = self._state.failure or failure
                lost = self._state.sensor_lost or sensor_lost
                self._state = replace(self._state, waits=True, failure=failure, sensor_lost=lost)

    def _step(self, pose: Pose, now_s: float, stamp_s: float) -> Command | None:
        """Return the velocity to command from now on; None to steer no longer."""
        follower = self._follower
        with self._lock:
            order, silent_s = self._order, self._mover.monotonic_s() - self._heard_s
            assert order is not None  # noqa: S101  # the loop starts with an order
            is_new = order.number > self._taken
            self._taken = order.number
        if silent_s > SILENT_S:
            self._fail(f"the workstation was silent for {silent_s:.1f} s")
            return None
        if is_new and not self._execute(order, pose):
            return None
        follower.may_leave = self._asking and order.leaves >= self._state.asks
        command = follower.step(pose, now_s, stamp_s)
        if follower.failure:
            self._fail(follower.failure, sensor_lost=follower.sensor_lost)
            return None
        asks_now = follower.would_leave and not self._asking
        self._asking = follower.would_leave
        left_m = follower.remaining_m
        with self._lock:
            self._state = replace(
                self._state,
                number=order.number,
                waits=follower.waits,
                remaining_m=left_m if math.isfinite(left_m) else None,
                asks=self._state.asks + asks_now,
            )
        return command

    def _execute(self, order: PathOrder, pose: Pose) -> bool:
        """Begin to execute a new order; return whether the base is steered on."""
        match order.task:
            case PathEnd.RELEASE:
                return False
            case PathEnd.STOP:
                self._follower.stop()
            case PathEnd.BRAKE:
                self._follower.brake()
            case movement:
                self._follower.follow(movement, pose if order.origin is None else order.origin, pose)
        return True

    def _fail(self, reason: str, *, sensor_lost: bool = False) -> None:
        with self._lock:
            self._state = replace(self._state, failure=reason, sensor_lost=sensor_lost)
