"""Confidence sequences by betting: valid however often one looks, for values of 0 to 1 that come in random order.

A gambler who starts with 1 and can only lose on average while the mean is `m` is seldom rich: the chance that the
capital ever reaches 1/alpha is at most alpha (Ville 1939). Here the values are drawn **without replacement** from a
plan of known size, so what is already seen says what the rest must be: if the mean of all N is m, the next value's
expectation is (N m - sum so far) / (N - number so far), and the bets are fair against that (Waudby-Smith and Ramdas
2020; 2024, Section 5). With replacement the expectation stays m. The bet is a mixture over fixed fractions of the
capital, so the capital never falls below 0, grows with every value, and the sequence for the mean is an interval.
"""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

FRACTIONS: Floats = np.array([0.15, 0.3, 0.5, 0.7])
"""Of the capital at stake in each bet; the capital is spread evenly over them."""


def capital(values: npt.ArrayLike, mean: npt.ArrayLike, size: int | None) -> Floats:
    """Return the greatest capital so far of betting that the mean is greater than `mean`.

    Args:
        values: (..., n) of 0 to 1, in the random order in which they were drawn.
        mean: the mean betted against, 0 to 1; broadcasts against the values' leading axes.
        size: how many values the plan has, n or more; None for draws with replacement, from a population without end.

    Returns:
        (..., n) the running maximum after each value. While the mean of the plan is at most `mean`, the chance that it
        ever reaches 1/alpha is at most alpha.
    """
    drawn = np.asarray(values, np.float64)
    against = np.asarray(mean, np.float64)
    shape = np.broadcast_shapes(drawn.shape[:-1], against.shape)
    count = drawn.shape[-1]
    if size is not None and size < count:
        raise ValueError(f"{count} values cannot come from a plan of {size}")
    stakes = np.ones((*shape, len(FRACTIONS))) / len(FRACTIONS)
    grown, total = np.ones(shape), np.zeros(shape)
    path = np.ones((*shape, count))
    for step in range(count):
        value = np.broadcast_to(drawn[..., step], shape)
        expected = np.broadcast_to(against, shape) if size is None else (size * against - total) / (size - step)
        total = total + value
        # A plan whose mean is that low cannot have gone on like this: the bet is won once and for all.
        won = (expected < -_TIE) | ((expected <= _TIE) & (value > _TIE))
        fair = np.maximum(expected, _TIE)
        growth = np.where(expected > _TIE, value / fair, 1.0)
        stakes = stakes * (1 - FRACTIONS + FRACTIONS * growth[..., None])
        grown = np.maximum(grown, np.where(won, np.inf, stakes.sum(-1)))
        path[..., step] = grown
    return path


_TIE = 1e-9


def p_values(values: npt.ArrayLike, mean: float, size: int | None) -> tuple[Floats, Floats]:
    """Return, after each value, the p-values of "the mean is at most `mean`" and of "it is at least `mean`".

    Valid at every look and at all of them together: the chance that one of a true hypothesis is ever at most alpha is
    at most alpha. Each only falls.
    """
    drawn = np.asarray(values, np.float64)
    above, below = capital(drawn, mean, size), capital(1 - drawn, 1 - mean, size)
    return np.minimum(1.0, 1 / above), np.minimum(1.0, 1 / below)


def sequence(values: npt.ArrayLike, size: int | None, alpha: float, steps: int = 2) -> tuple[Floats, Floats]:
    """Return the ends of the confidence sequence for the mean after each value: all of them hold together.

    Args:
        values: (n,) multiples of 1 / `steps`, in the order in which they were drawn.
        size: how many the plan has; None for draws with replacement.
        alpha: chance that the mean is ever outside.
        steps: 1 for successes and failures, 2 for differences of two (mapped from -1, 0, 1 to 0, 1/2, 1).

    Returns:
        (n,) and (n,): the least and the greatest mean that is not ruled out. Of a plan they are means that it can have.
    """
    drawn = np.asarray(values, np.float64)
    possible = size * steps if size is not None else _FINE
    means = np.arange(possible + 1) / possible
    some = np.broadcast_to(drawn, (len(means), len(drawn)))
    low = _ends(capital(some, means, size) < 2 / alpha, means)
    high = 1 - _ends(capital(1 - some, means, size) < 2 / alpha, means)
    return low, high


_FINE = 2000


def _ends(kept: npt.NDArray[np.bool_], means: Floats) -> Floats:
    """Return the least mean that is kept after each value, (n,); the capital falls with the mean betted against."""
    first = np.argmax(kept, axis=0)
    found = np.where(kept.any(axis=0), means[first], math.nan)
    return np.asarray(found, np.float64)


def as_share(difference: npt.ArrayLike) -> Floats:
    """Map paired differences, -1 to 1, to 0 to 1."""
    return (np.asarray(difference, np.float64) + 1) / 2
