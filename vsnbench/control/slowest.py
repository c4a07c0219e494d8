"""The slowest velocity that moves a base: motors do not turn at commands below it."""

import math

from vsnbench.control.settings import MotionSettings
from vsnbench.control.stall import StallMonitor

_RAISE = 1.4
"""A velocity that did not move the base is raised by this factor."""
_LOOK_S = 0.12
"""Time after the base's delay in which a moving base shows its motion."""
_MOST = 0.5
"""Highest slowest velocity, as a share of the cruising speed."""


class SlowestVelocity:
    """Finds the slowest velocity of one axis, and avoids slower commands.

    Args:
        velocity: slowest velocity known from earlier movements or the profile; 0 if none is known.
        cruise: cruising speed of the axis; the slowest velocity is at most a share of it.
        tolerance: tolerance of the movement; infinity where nothing is to be found out.
        settings: settings of the movement.
    """

    def __init__(self, velocity: float, cruise: float, tolerance: float, settings: MotionSettings) -> None:
        self.velocity = velocity
        self._limit = _MOST * cruise
        self._tolerance = tolerance
        self._settle_s = settings.settle_s
        self._owed = 0.0
        self._monitor: StallMonitor | None = None

    @property
    def due_s(self) -> float:
        """Time of the next comparison; earlier calls of `look` are not needed."""
        return self._monitor.due_s if self._monitor else -math.inf

    def least(self, period_s: float) -> float:
        """Return the smallest amount that a correction improves: half of one period at the slowest velocity."""
        return 0.5 * self.velocity * period_s

    def raised(self, velocity: float, remaining: float, period_s: float) -> float:
        """Return the velocity to command instead of a slow one: it covers the rest in whole periods."""
        step = self.velocity * period_s
        if velocity > 2 * self.velocity or remaining > 4 * step:
            return max(velocity, self.velocity)
        periods = max(math.floor(remaining / step), 1)
        return max(remaining / (periods * period_s), self.velocity)

    def look(self, now_s: float, left: float, commanded: float, velocity: float, delay_s: float) -> None:
        """Take the state of a braking base; a velocity that did not move it is raised."""
        if not self._monitor:
            self._monitor = StallMonitor(delay_s + max(_LOOK_S, self._settle_s), 0.5 * self._tolerance)
        if self._monitor.is_stuck(now_s, -left, commanded):
            self.too_slow(velocity)
            self._monitor = None

    def too_slow(self, velocity: float) -> None:
        """Raise the velocity, because a command did not move the base."""
        # The limit keeps a base that is held by an obstacle from pushing ever harder.
        self.velocity = max(self.velocity, min(_RAISE * max(velocity, self.velocity), self._limit))

    def in_turns(self, velocity: float, period_s: float) -> float:
        """Return a velocity that is zero or fast enough, and whose mean over several periods is `velocity`."""
        if abs(velocity) >= self.velocity:
            return velocity
        self._owed += velocity * period_s
        step = self.velocity * period_s
        if abs(self._owed) < step:
            return 0.0
        self._owed -= math.copysign(step, self._owed)
        return math.copysign(self.velocity, velocity)
