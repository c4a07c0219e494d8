"""Whether a robot that drives on has been standing still for long."""

import math

from vsnbench.protocol.execution import Execution
from vsnbench.values.pose import Pose, wrap_angle

_STUCK_S = 2.0
_STUCK_M, _STUCK_RAD = 0.02, math.radians(3)
"""A robot that has moved less than this for that long was stopped by the guard."""


class Standstill:
    """Since when the robot of an episode has been where it is.

    Args:
        execution: that of the protocol; a robot also waits for the answers of a slow model.
    """

    def __init__(self, execution: Execution | None) -> None:
        latency_s = 0.0 if execution is None else execution.latency_s or 0.0
        self._longest_s = _STUCK_S + 2 * latency_s
        self._since: tuple[float, Pose] | None = None

    def is_stuck(self, here: Pose, now_s: float) -> bool:
        """Take a pose and its time; return whether the robot has been there for longer than an answer needs."""
        since = self._since
        if (
            since is None
            or here.distance_to(since[1]) > _STUCK_M
            or abs(wrap_angle(here.heading_rad - since[1].heading_rad)) > _STUCK_RAD
        ):
            self._since = now_s, here
            return False
        return now_s - since[0] > self._longest_s

    def forget(self) -> None:
        """Begin again with the next pose."""
        self._since = None
