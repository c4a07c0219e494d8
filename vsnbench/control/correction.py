"""Corrections of a movement at rest: how much to command, and what they show of the base."""

from vsnbench.control.slowest import SlowestVelocity

_UNSEEN_DELAY_S = 0.25
"""Delay that is assumed once a correction had no effect: a base that moves more than commanded hides its own."""
_MISSED_SHARE = 0.25
"""A correction that achieved less than this share came too late or was too slow for the base."""
_JUDGED = 0.3
"""Larger corrections, as a share of the tolerance, show how much of a correction the base makes."""
_LEAST_GAIN = 0.3
_EVEN_GAINS = 0.8, 1.25
"""Gains of corrections that need no other command."""
COARSE = 4.0
"""Errors above this multiple of the tolerance are corrected under feedback, smaller ones by dead reckoning."""


class Correction:
    """The corrections of one movement.

    Args:
        tolerance: tolerance of the movement; metres or radians.
        slowest: slowest velocity of the base.
        knows_delay: whether the delay of the base is known from earlier movements.

    Attributes:
        amount: what to command now; negative against the direction of the movement.
        is_reckoned: whether it is measured by the commands alone.
        extra_delay_s: time to wait for the effect of a correction.
    """

    def __init__(self, tolerance: float, slowest: SlowestVelocity, *, knows_delay: bool) -> None:
        self._tolerance = tolerance
        self._slowest = slowest
        self._knows_delay = knows_delay
        self._error = 0.0
        self._gain = 1.0
        self._fastest = 0.0
        self.amount = 0.0
        self.is_reckoned = False
        self.extra_delay_s = 0.0

    def drives(self, velocity: float) -> None:
        """Take a velocity of the running correction."""
        self._fastest = max(self._fastest, velocity)

    def begin(self, error: float) -> None:
        """Begin the correction of an error at rest, after judging the correction before it."""
        if self.amount:
            self._judge(self._error - error)
        # Feedback that overshoots has a wrong delay; dead reckoning needs none.
        overshot = self.amount * error < 0
        self.is_reckoned = overshot or abs(error) <= COARSE * self._tolerance
        self.amount = error / self._gain if self.is_reckoned else error
        self._error, self._fastest = error, 0.0

    def _judge(self, achieved: float) -> None:
        """Learn from the last correction how much of it the base made."""
        if abs(achieved) < _MISSED_SHARE * abs(self.amount):
            if self._knows_delay or self.extra_delay_s:
                self._slowest.too_slow(self._fastest)
            self.extra_delay_s = _UNSEEN_DELAY_S
        elif self.is_reckoned and abs(self.amount) > _JUDGED * self._tolerance:
            gain = achieved / self.amount
            if gain > 0 and not _EVEN_GAINS[0] <= gain <= _EVEN_GAINS[1]:
                self._gain = min(max(gain, _LEAST_GAIN), 1 / _LEAST_GAIN)
