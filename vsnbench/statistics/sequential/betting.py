"""Confidence sequences by betting, valid at every look, for values from 0 to 1 in random order.

A bet against "the mean is `m`" starts with a capital of 1. If the mean is `m`, the capital cannot grow on average, and
the probability that it ever reaches 1/alpha is at most alpha (Ville 1939). The values are drawn **without replacement**
from a plan of known size, so the values seen so far determine what the rest must be: if the mean of all N is m, the
next value's expectation is (N m - sum so far) / (N - number so far), and the bets are fair against that expectation
(Waudby-Smith and Ramdas 2020; 2024, Section 5). With replacement the expectation stays m. The bet is a mixture over
fixed fractions of the capital. The capital therefore stays at or above 0 and grows with every value, and the confidence
sequence is an interval.
"""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

FRACTIONS: Floats = np.array([0.15, 0.3, 0.5, 0.7])
"""Fractions of the capital staked on single outcomes; the capital is divided evenly among them."""
MEAN_FRACTIONS: Floats = np.array([0.7, 0.95])
"""Fractions for bets on means of several outcomes, which vary less."""
PROGRESS_FRACTIONS: Floats = np.array([0.5, 0.95])
"""Fractions for bets on progress by block, whose differences are smaller and vary less than those of success."""
PROGRESS_MEAN_FRACTIONS: Floats = np.array([0.95])
"""Fractions for bets on mean progress of several outcomes."""
_LIMIT = 1e200
"""Cap of the capital. A larger capital decides nothing more, and the next product would overflow."""


def capital(values: npt.ArrayLike, mean: npt.ArrayLike, size: int | None, fractions: Floats = FRACTIONS) -> Floats:
    """Return the running maximum of the capital of a bet that the mean is greater than `mean`.

    Args:
        values: (..., n) values from 0 to 1, in the random order of drawing.
        mean: mean under the null hypothesis, 0 to 1; broadcasts against the leading axes of `values`.
        size: number of values in the plan, at least n; None for draws with replacement.
        fractions: fractions of the capital staked in each bet, between 0 and 1.

    Returns:
        (..., n) the running maximum after each value. If the mean of the plan is at most `mean`, the probability that
        it ever reaches 1/alpha is at most alpha.
    """
    drawn = np.asarray(values, np.float64)
    against = np.asarray(mean, np.float64)
    shape = np.broadcast_shapes(drawn.shape[:-1], against.shape)
    count = drawn.shape[-1]
    if size is not None and size < count:
        raise ValueError(f"{count} values cannot come from a plan of {size}")
    stakes = np.ones((*shape, len(fractions))) / len(fractions)
    grown, total = np.ones(shape), np.zeros(shape)
    path = np.ones((*shape, count))
    for step in range(count):
        value = np.broadcast_to(drawn[..., step], shape)
        expected = np.broadcast_to(against, shape) if size is None else (size * against - total) / (size - step)
        total = total + value
        # The mean under test is impossible with these values: it is rejected for good.
        won = (expected < -_TIE) | ((expected <= _TIE) & (value > _TIE))
        fair = np.maximum(expected, _TIE)
        growth = np.where(expected > _TIE, value / fair, 1.0)
        stakes = np.minimum(_LIMIT, stakes * (1 - fractions + fractions * growth[..., None]))
        grown = np.maximum(grown, np.where(won, np.inf, stakes.sum(-1)))
        path[..., step] = grown
    return path


_TIE = 1e-9


def p_values(
    values: npt.ArrayLike, mean: float, size: int | None, fractions: Floats = FRACTIONS
) -> tuple[Floats, Floats]:
    """Return the p-values of "the mean is at most `mean`" and "at least `mean`" after each value.

    The p-values never increase and are valid at all looks together: for a true hypothesis the probability that its
    p-value ever falls to alpha is at most alpha.
    """
    drawn = np.asarray(values, np.float64)
    above, below = capital(drawn, mean, size, fractions), capital(1 - drawn, 1 - mean, size, fractions)
    return np.minimum(1.0, 1 / above), np.minimum(1.0, 1 / below)


def sequence(
    values: npt.ArrayLike, size: int | None, alpha: float, steps: int | None = 2, fractions: Floats = FRACTIONS
) -> tuple[Floats, Floats]:
    """Return the lower and upper ends of the confidence sequence for the mean after each value.

    Args:
        values: (n,) in the order of drawing; multiples of 1 / `steps` if `size` and `steps` are given.
        size: number of values in the plan; None for draws with replacement.
        alpha: probability that the mean is ever outside the sequence.
        steps: 1 for successes and failures, 2 for differences of two outcomes (mapped from -1, 0, 1 to 0, 1/2, 1),
            None for any values from 0 to 1.
        fractions: fractions of the capital staked in each bet.

    Returns:
        (n,) and (n,): the smallest and largest mean not rejected. With a plan and steps, both are means that the plan
        can have; without steps they are rounded outwards to 1/2000.
    """
    drawn = np.asarray(values, np.float64)
    possible = size * steps if size is not None and steps is not None else _FINE
    means = np.arange(possible + 1) / possible
    some = np.broadcast_to(drawn, (len(means), len(drawn)))
    low = _ends(capital(some, means, size, fractions) < 2 / alpha, means)
    high = 1 - _ends(capital(1 - some, means, size, fractions) < 2 / alpha, means)
    if steps is None:
        return np.maximum(low - 1 / _FINE, 0.0), np.minimum(high + 1 / _FINE, 1.0)
    return low, high


_FINE = 2000


def _ends(kept: npt.NDArray[np.bool_], means: Floats) -> Floats:
    """Return the smallest mean that is not rejected after each value, (n,)."""
    first = np.argmax(kept, axis=0)
    found = np.where(kept.any(axis=0), means[first], math.nan)
    return np.asarray(found, np.float64)


def as_share(difference: npt.ArrayLike) -> Floats:
    """Map paired differences from [-1, 1] to [0, 1]."""
    return (np.asarray(difference, np.float64) + 1) / 2
