"""Group-sequential sign-flip tests over starting positions, exact at a few planned looks together.

The signs of the differences of whole starting positions are flipped (`vsnbench.statistics.permutation`). Under the null
hypothesis all sign patterns of the positions so far are equally likely, at the last look as at the first, so the joint
distribution of the p-values of all looks is counted and not approximated. The looks share alpha by the power family of
Kim and DeMets (1987): up to a look at a share t of the positions, at most alpha * t**rho of it is spent (Lan and DeMets
1983). The p-value at a look is recursive: the smaller of the previous look's and of this look's own p-value over its
weight, and its rank among all sign patterns (Westfall and Young's minimum p-value, 1993). It never increases, and the
probability that it ever falls to alpha is at most alpha, for every alpha; Holm's steps can therefore be taken at every
look (Bartroff and Song 2014).

The interval at a look is a repeated confidence interval (Jennison and Turnbull 1989): `vsnbench.statistics.paired` at
this look's share of alpha. The intervals of all looks hold together, so stopping early does not reduce their coverage.
Inverting the sign-flip test instead would assume that differences are symmetric about their mean; where they are not,
such an interval covers too rarely (docs/statistics.md).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
SPENDING = 2.5
"""Exponent rho of the share of alpha that a look may spend."""
EXACT_UP_TO = 20
"""Largest number of starting positions whose sign patterns are all counted."""
DRAWS = 49_999
"""Number of sign patterns that are drawn for more positions, with a fixed seed."""
_TICKS = 1e7
_TIE = 1e-8
_NEAR = 1e-4
_FEW_DRAWS = 5_000
_FINEST = 240
_CHUNK = 4_000_000
_SLACK = 1 + 1e-12


def spent_shares(looks: Sequence[int], spending: float = SPENDING) -> tuple[float, ...]:
    """Return the share of alpha that may be spent up to each look; 1 at the last.

    Args:
        looks: increasing numbers of complete starting positions; the last is the planned number.
        spending: exponent of the share of the positions.
    """
    return tuple(float((look / looks[-1]) ** spending) for look in looks)


def look_weights(looks: Sequence[int], spending: float = SPENDING) -> tuple[float, ...]:
    """Return the share of alpha of each look alone; they sum to 1."""
    shares = (0.0, *spent_shares(looks, spending))
    return tuple(after - before for before, after in pairwise(shares))


def earliest_look(planned: int, alpha: float, spending: float = SPENDING) -> int | None:
    """Return the smallest number of positions at which a two-sided test can reject at `alpha`; None if never.

    Args:
        planned: planned number of starting positions.
        alpha: level divided by the number of questions.
        spending: exponent of the share of the positions.
    """
    return next(
        (look for look in range(1, planned + 1) if 2.0 ** (1 - look) <= alpha * (look / planned) ** spending), None
    )


def default_looks(planned: int, alpha: float, spending: float = SPENDING) -> tuple[int, ...]:
    """Return looks after about half and three quarters of the positions, and after all: 8, 11 and 15 of 15.

    A look at which nothing could be decided is left out.
    """
    earliest = earliest_look(planned, alpha, spending) or planned
    interim = {(8 * planned + 7) // 15, (11 * planned + 7) // 15}
    return (*sorted(look for look in interim if earliest <= look < planned), planned)


def sequential_p(differences: npt.ArrayLike, looks: Sequence[int], spending: float = SPENDING) -> Floats:
    """Return the one-sided p-values of "the mean difference is at most 0" after each look that is reached.

    Args:
        differences: (samples, positions) differences of whole starting positions in the order of their completion.
            To test another difference than 0, subtract it first.
        looks: all planned looks, increasing; those above the number of positions are not reached.
        spending: exponent of the share of the positions.

    Returns:
        (samples, looks reached), non-increasing along the looks.
    """
    values = np.asarray(differences, np.float64)
    reached = [look for look in looks if look <= values.shape[1]]
    shares, weights = spent_shares(looks, spending), look_weights(looks, spending)
    if not reached:
        return np.ones((len(values), 0))
    exact = reached[-1] <= EXACT_UP_TO
    found = [
        _counted_p(row, reached, shares, weights) if exact else _drawn_p(row, reached, shares, weights)
        for row in values
    ]
    return np.asarray(np.minimum(1.0, np.array(found).reshape(len(values), len(reached))), np.float64)


def sequential_signs(
    differences: npt.ArrayLike, looks: Sequence[int], level: float, spending: float = SPENDING
) -> npt.NDArray[np.int8]:
    """Return which one-sided test rejects up to each look, for many samples: the same decisions as `sequential_p`.

    Args:
        differences: (samples, positions) differences in the order of completion; all positions of the last look.
        looks: all planned looks, increasing; the last is at most `EXACT_UP_TO`, or the signs are drawn.
        level: level of each one-sided test.
        spending: exponent of the share of the positions.

    Returns:
        (samples, looks) 1 where the mean is found above 0, -1 where it is found below, 0 otherwise.
    """
    values = np.asarray(differences, np.float64)
    weights = np.array(look_weights(looks, spending))
    found = np.zeros((len(values), len(looks)), np.int8)
    above, below = _own_shares(values, looks)
    for sign, own in ((1, above), (-1, below)):
        for place in range(len(looks)):
            some = own[:, : place + 1]
            # The p-value is at most the sum over the looks, and at least the smallest of their own ones.
            sure = (some / weights[: place + 1]).min(1) <= level
            possible = some.min(1) <= level * spent_shares(looks, spending)[place]
            found[sure, place] = sign
            unsure = possible & ~sure & (found[:, place] != sign)
            if place:
                unsure &= found[:, place - 1] != sign
                found[found[:, place - 1] == sign, place] = sign
            if unsure.any():
                p = sequential_p(sign * values[unsure, : looks[place]], looks, spending)[:, -1]
                found[np.flatnonzero(unsure)[p <= level], place] = sign
    return found


def _own_shares(values: Floats, looks: Sequence[int]) -> tuple[Floats, Floats]:
    """Return the share of sign patterns whose sum is at least, and at most, the observed one: (samples, looks) each."""
    if looks[-1] <= EXACT_UP_TO and (steps := _whole_steps(values[:, : looks[-1]])) is not None:
        return _lattice_shares(steps, looks)
    above, below = (np.empty((len(values), len(looks))) for _ in range(2))
    for place, look in enumerate(looks):
        signs = _half_patterns(look)
        step = max(1, _CHUNK // signs.shape[1])
        for at in range(0, len(values), step):
            some = values[at : at + step, :look].astype(np.float32)
            sums, observed = some @ signs, some.sum(1)[:, None]
            for target, turned in ((above, observed), (below, -observed)):
                beyond = (sums >= turned - _NEAR).mean(1) + (sums <= _NEAR - turned).mean(1)
                target[at : at + step, place] = beyond / 2
    return above, below


def _whole_steps(values: Floats) -> npt.NDArray[np.int64] | None:
    """Return the differences as multiples of a common fraction; None if there is none of a few hundredths."""
    for unit in range(1, _FINEST + 1):
        steps = np.rint(values * unit)
        if float(np.abs(values * unit - steps).max(initial=0.0)) < _TIE * unit:
            return np.asarray(steps, np.int64)
    return None


def _lattice_shares(steps: npt.NDArray[np.int64], looks: Sequence[int]) -> tuple[Floats, Floats]:
    """Return the shares of `_own_shares` for whole numbers, from the characteristic function of the flipped sum."""
    reach = int(np.abs(steps).sum(1).max(initial=1))
    size = 1 << (2 * reach + 1).bit_length()
    waves = np.cos(
        2 * np.pi / size * np.outer(np.arange(int(np.abs(steps).max(initial=0)) + 1), np.arange(size // 2 + 1))
    )
    product, before = np.ones((len(steps), size // 2 + 1)), 0
    above, below = (np.empty((len(steps), len(looks))) for _ in range(2))
    for place, look in enumerate(looks):
        for column in np.abs(steps[:, before:look]).T:
            product *= waves[column]
        before = look
        chances = np.roll(np.fft.irfft(product, size, axis=1), reach, axis=1)[:, : 2 * reach + 1]
        tails = np.cumsum(chances[:, ::-1], axis=1)[:, ::-1]
        observed = steps[:, :look].sum(1)
        for target, turned in ((above, observed), (below, -observed)):
            share = np.take_along_axis(tails, (reach + turned)[:, None], axis=1)[:, 0]
            target[:, place] = np.rint(share * 2.0**look) / 2.0**look  # a count of patterns
    return above, below


def _half_patterns(positions: int) -> npt.NDArray[np.float32]:
    """Return (positions, patterns) signs; the others are the mirror images. Drawn ones above `EXACT_UP_TO`."""
    if positions > EXACT_UP_TO:
        signs = np.random.default_rng(0).integers(0, 2, (positions, _FEW_DRAWS), dtype=np.int8)
    else:
        signs = (np.arange(2 ** (positions - 1)) >> np.arange(positions)[:, None]) & 1
    return np.asarray(1 - 2 * signs, np.float32)


def _counted_p(row: Floats, reached: Sequence[int], shares: Sequence[float], weights: Sequence[float]) -> list[float]:
    """Return the p-values of one sample at each look, from all sign patterns."""
    sums, previous, before = np.zeros(1), np.full(1, np.inf), 0
    found = []
    for place, look in enumerate(reached[:-1]):
        sums = _extended(sums, row[before:look])
        previous = np.repeat(previous, len(sums) // len(previous))
        previous = _all_p(np.rint(sums * _TICKS), previous, shares[place], weights[place])
        found.append(float(previous[0]))
        before = look
    look = reached[-1]
    half = max(before, look // 2)
    sums = _extended(sums, row[before:half])
    previous = np.repeat(previous, len(sums) // len(previous))
    tail = _extended(np.zeros(1), row[half:look])
    own = _share_beyond(np.sort(sums), tail, float(row[:look].sum()))
    share, weight = shares[len(reached) - 1], weights[len(reached) - 1]
    least = min(float(previous[0]), own / weight) * _SLACK
    known = previous <= least
    if known.any() or own > weight * least:
        critical = _critical((sums[:, None] + tail).ravel(), int(weight * least * len(sums) * len(tail)))
        free = np.sort(sums[~known])
        own = float(known.mean()) + _share_beyond(free, tail, critical) * len(free) / len(sums)
    return [*found, own / share]


def _share_beyond(ordered: Floats, tail: Floats, critical: float) -> float:
    """Return the share of sums of an element of each array that reach a value; `ordered` is ascending."""
    if not len(ordered):
        return 0.0
    below = np.searchsorted(ordered, critical - tail - _TIE)
    return 1.0 - float(below.mean()) / len(ordered)


def _drawn_p(row: Floats, reached: Sequence[int], shares: Sequence[float], weights: Sequence[float]) -> list[float]:
    """Return the p-values of one sample at each look from seeded sign patterns (Phipson and Smyth 2010)."""
    signs = np.random.default_rng(0).integers(0, 2, (DRAWS + 1, reached[-1]), dtype=np.int8) * 2.0 - 1.0
    signs[0] = 1.0  # the observed pattern
    previous, found = np.full(len(signs), np.inf), []
    for place, look in enumerate(reached):
        ticks = np.rint(signs[:, :look] @ row[:look] * _TICKS)
        previous = _all_p(ticks, previous, shares[place], weights[place])
        found.append(float(previous[0]))
    return found


def _extended(sums: Floats, added: Floats) -> Floats:
    """Return the sums over all sign patterns with further positions; the first pattern has no flipped sign."""
    for difference in added:
        sums = np.stack((sums + difference, sums - difference), axis=1).ravel()
    return sums


def _all_p(ticks: Floats, previous: Floats, share: float, weight: float) -> Floats:
    """Return the p-value of every sign pattern at a look, (patterns,)."""
    count = len(ticks)
    own = (count - np.searchsorted(np.sort(ticks), ticks)) / count
    least = np.minimum(previous, own / weight)
    return np.asarray(np.searchsorted(np.sort(least), least * _SLACK, side="right") / count / share, np.float64)


def _critical(sums: Floats, rank: int) -> float:
    """Return the smallest value that at most `rank` of the sums reach."""
    if rank >= len(sums):
        return -np.inf
    if not rank:
        return np.inf
    least = float(np.partition(sums, len(sums) - rank)[len(sums) - rank])
    return least if int((sums >= least - _TIE).sum()) <= rank else least + 2 * _TIE
