"""Exact test of whether success changes with time, stratum by stratum.

The statistic is the sum of the ranks in time of the successes within each stratum (Wilcoxon 1945; Mann and Whitney
1947). Under the null hypothesis every order of a stratum's outcomes is equally likely; the distribution of the sum is
computed exactly.
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
    """Result of the trend test."""

    p: float
    """Two-sided p-value for "success does not depend on time"."""
    least_p: float
    """Smallest p-value that any order of these outcomes could give; above 0.05 the test cannot reject."""
    later: float
    """Share of pairs of a success and a failure in one stratum in which the success is later: 0.5 means no trend; NaN
    without such pairs."""
    exact: bool
    """False if the normal approximation was used because of the number of trials."""


def trend(strata: Sequence[Sequence[bool]]) -> Trend:
    """Test whether success changes with time.

    Args:
        strata: outcomes of each stratum (a goal in a session) in the order of time; strata are not compared.
    """
    sizes = [(sum(stratum), len(stratum) - sum(stratum)) for stratum in map(list, strata)]
    pairs = sum(won * lost for won, lost in sizes)
    if not pairs:
        return Trend(1.0, 1.0, math.nan, exact=True)
    seen = sum(_success_later(stratum) for stratum in strata)
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
    """Return the number of success-failure pairs in which the success is later."""
    lost = pairs = 0
    for won in outcomes:
        pairs += lost if won else 0
        lost += not won
    return pairs


def _chances(won: int, lost: int) -> Floats:
    """Return the probabilities that the success is later in 0, 1, ... `won * lost` pairs."""
    row: list[Floats] = [np.ones(1)] * (lost + 1)
    for successes in range(1, won + 1):
        following: list[Floats] = [np.ones(1)]
        for failures in range(1, lost + 1):
            here = np.zeros(successes * failures + 1)
            # The last outcome was either a success, which is later than all failures, or a failure.
            here[failures:] += successes * row[failures]
            here[: len(following[-1])] += failures * following[-1]
            following.append(here / (successes + failures))
        row = following
    return row[lost]


def _two_sided(deviations: float) -> float:
    return math.erfc(deviations / math.sqrt(2))
