"""Whether success changes with time: an exact test in which only the order within a stratum is chance's.

The statistic is the sum of the places in time of the successes, stratum by stratum (Wilcoxon 1945; Mann and Whitney
1947). Where success has nothing to do with time, every order of a stratum's outcomes is as likely as every other; how
likely each sum is is counted, not drawn. At most 5 % of p-values are below 0.05 then.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
_MOST_WORK = 50_000_000
_TIE = 1e-9


@dataclass(frozen=True, slots=True)
class Trend:
    """What the order of successes and failures says."""

    p: float
    """Two-sided, of success and time having nothing to do with each other."""
    least_p: float
    """The smallest p that any order of these very outcomes would have given: above 0.05, nothing could be found."""
    later: float
    """How often, of a success and a failure of one stratum, the success was the later one: 0.5 is no trend; NaN for no
    such pair."""
    exact: bool
    """False where there are so many trials that the normal distribution stands for the count."""


def trend(strata: Sequence[Sequence[bool]]) -> Trend:
    """Return what the order of outcomes says of success and time.

    Args:
        strata: the outcomes of each stratum (a goal in a session), in the order of time; none between strata counts.
    """
    sizes = [(sum(each), len(each) - sum(each)) for each in map(list, strata)]
    pairs = sum(won * lost for won, lost in sizes)
    if not pairs:
        return Trend(1.0, 1.0, math.nan, exact=True)
    seen = sum(_success_later(each) for each in strata)
    away = abs(seen - pairs / 2)
    if sum((won * lost) ** 2 for won, lost in sizes) > _MOST_WORK:
        spread = math.sqrt(sum(won * lost * (won + lost + 1) for won, lost in sizes) / 12)
        return Trend(_two_sided(away / spread), _two_sided(pairs / 2 / spread), seen / pairs, exact=False)
    chances: Floats = np.ones(1)
    for won, lost in sizes:
        chances = np.convolve(chances, _chances(won, lost))
    apart = np.abs(np.arange(pairs + 1) - pairs / 2)
    p = float(min(1.0, chances[apart >= away - _TIE].sum()))
    return Trend(p, float(min(1.0, chances[0] + chances[-1])), seen / pairs, exact=True)


def _success_later(outcomes: Sequence[bool]) -> int:
    """Return in how many pairs of a success and a failure the success was the later one."""
    lost = pairs = 0
    for won in outcomes:
        pairs += lost if won else 0
        lost += not won
    return pairs


def _chances(won: int, lost: int) -> Floats:
    """Return how likely it is that the successes are the later ones in 0, 1, ... `won * lost` pairs."""
    row: list[Floats] = [np.ones(1)] * (lost + 1)
    for successes in range(1, won + 1):
        following: list[Floats] = [np.ones(1)]
        for failures in range(1, lost + 1):
            here = np.zeros(successes * failures + 1)
            # The last of them all was a success, which is later than all failures, or it was a failure.
            here[failures:] += successes * row[failures]
            here[: len(following[-1])] += failures * following[-1]
            following.append(here / (successes + failures))
        row = following
    return row[lost]


def _two_sided(deviations: float) -> float:
    return math.erfc(deviations / math.sqrt(2))
