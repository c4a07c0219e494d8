"""Are two models as good as each other, within a margin named before? Two one-sided tests (Schuirmann 1987).

"Not distinguishable" is no such claim: too few trials never tell anything apart. Two rates are equivalent where the
90 % interval of their difference lies within the margin; at most 5 % of pairs further apart are called so.
"""

from dataclasses import dataclass

from vsnbench.statistics.clustered import Outcomes, independent_difference
from vsnbench.statistics.paired import PairedOutcomes, paired_interval
from vsnbench.statistics.rates import Interval


@dataclass(frozen=True, slots=True)
class Equivalence:
    """Whether two rates are equivalent within a margin."""

    margin: float
    """The largest difference that does not matter, above 0, as a share."""
    interval: Interval
    """Of the difference, at twice the level: 90 %."""

    @property
    def shown(self) -> bool:
        """Whether the whole interval lies within the margin."""
        return self.interval.known and -self.margin < self.interval.low and self.interval.high < self.margin

    @property
    def excluded(self) -> bool:
        """Whether the whole interval lies outside of it: they differ by more than the margin."""
        return self.interval.known and (self.interval.low > self.margin or self.interval.high < -self.margin)


def paired_equivalence(outcomes: PairedOutcomes, margin: float, level: float = 0.05) -> Equivalence:
    """Return whether two models are equivalent in the cells they share."""
    return Equivalence(_checked(margin), paired_interval(outcomes, 1 - 2 * level))


def independent_equivalence(first: Outcomes, second: Outcomes, margin: float, level: float = 0.05) -> Equivalence:
    """Return whether two separate samples' rates are equivalent."""
    return Equivalence(_checked(margin), independent_difference(first, second, 1 - 2 * level))


def _checked(margin: float) -> float:
    if not 0 < margin < 1:
        raise ValueError(f"a margin is a share above 0 and below 1, not {margin}")
    return margin
