"""Detection of a base that does not follow its commands."""

import math
from collections import deque

_SHARE = 0.1
"""A base is stuck if it covers less than this share of what was commanded."""
DRIVE_SHARE = 0.85
"""Window of a movement with parameters, as a share of `stall_s`: with the delays of commands and odometry, a stuck base
is found within `stall_s`. A dead time of 0.5 s is not yet a stall.
"""
_HOPS = 10
"""Number of marks per window; a stall is detected this share of the window late at most."""


class StallMonitor:
    """Compares what a base covered with what was commanded, in a window of the latest `stall_s`.

    Args:
        stall_s: length of the window.
        least: smallest commanded amount that a base must follow: metres or radians.
    """

    def __init__(self, stall_s: float, least: float) -> None:
        self._stall_s = stall_s
        self._least = least
        self._marks: deque[tuple[float, complex, float]] = deque()
        """Time, and what was covered and commanded until then; oldest first."""
        self.due_s = -math.inf
        """Time of the next comparison; earlier calls of `is_stuck` are not needed."""

    def restart(self) -> None:
        """Begin a new window with the next call."""
        self._marks.clear()
        self.due_s = -math.inf

    def is_stuck(self, now_s: float, covered: complex, commanded: float) -> bool:
        """Add what was covered and commanded so far; return whether the base is stuck.

        Args:
            now_s: time; calls before `due_s` change nothing.
            covered: amount by the odometry, positive in the direction of the motion; or a position, x + iy.
            commanded: amount by the commands.
        """
        if now_s < self.due_s:
            return False
        self.due_s = now_s + self._stall_s / _HOPS
        self._marks.append((now_s, covered, commanded))
        while len(self._marks) > 2 and now_s - self._marks[1][0] >= self._stall_s - 1e-6:
            self._marks.popleft()
        began_s, covered_before, commanded_before = self._marks[0]
        if now_s - began_s < self._stall_s - 1e-6:
            return False
        asked = abs(commanded - commanded_before)
        return asked > self._least and abs(covered - covered_before) < _SHARE * asked
