"""N-SCORE (Snyder et al. 2026, arXiv 2603.13616) for many simulated studies at once, checked against its package.

A capital starts at 1 and is multiplied by 1 + share x difference after every unit. The share maximizes the expected
growth under the frequencies of the scores so far; a side is decided once its capital is at least 1 / alpha.
"""

from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
_SHARES = (np.arange(100) + 0.5) / 100
_PRIOR = 2.0
PACKAGE = "nscore"


def n_score(
    first: Floats, second: Floats, bins: int, alpha: float
) -> tuple[npt.NDArray[np.int8], npt.NDArray[np.int64]]:
    """Return which side is decided, 1 for the first, -1 for the second, 0 for none; and the number of units run.

    Args:
        first: (studies, units) scores of the first model, 0 to 1, in running order.
        second: scores of the second model.
        bins: number of equidistant scores by which frequencies are counted; for outcomes 2.
        alpha: level of each side.
    """
    scores = np.linspace(0, 1, bins)
    studies, units = first.shape
    counts = np.full((2, studies, bins), _PRIOR / bins)
    capitals = np.ones((2, studies))
    signs, run = np.zeros(studies, np.int8), np.full(studies, units)
    for unit in range(units):
        left = np.flatnonzero(signs == 0)
        if not len(left):
            break
        states, state = np.unique(counts[:, left].swapaxes(0, 1).reshape(len(left), -1), axis=0, return_inverse=True)
        shares = _shares(states.reshape(-1, 2, bins).swapaxes(0, 1), scores)[:, state.ravel()]
        apart = first[left, unit] - second[left, unit]
        capitals[:, left] *= 1 + shares * np.stack((apart, -apart))
        for side, sign in enumerate((1, -1)):
            decided = left[capitals[side, left] >= 1 / alpha]
            signs[decided], run[decided] = sign, unit + 1
        for place, values in enumerate((first[left, unit], second[left, unit])):
            counts[place, left, np.searchsorted(scores, values + 1e-9, side="right") - 1] += 1
    return signs, run


def _shares(counts: Floats, scores: Floats) -> Floats:
    """Return (2, studies) the share that each side stakes on the next unit."""
    chances = counts / counts.sum(2, keepdims=True)
    leads = chances[0] @ scores > chances[1] @ scores
    growth = np.zeros((len(leads), len(_SHARES)))
    ahead, behind = np.where(leads[:, None], chances[0], chances[1]), np.where(leads[:, None], chances[1], chances[0])
    for low in range(len(scores)):
        for high in range(low + 1, len(scores)):
            step = scores[high] - scores[low]
            gain, loss = ahead[:, high] * behind[:, low], ahead[:, low] * behind[:, high]
            net = (gain - loss)[:, None]
            growth += np.abs(net) * np.log(1 + np.sign(net) * _SHARES * step)
            growth += np.outer(np.minimum(gain, loss), np.log(1 - (_SHARES * step) ** 2))
    best = _SHARES[growth.argmax(1)]
    even = np.isclose(chances[0] @ scores, chances[1] @ scores, rtol=0, atol=1e-12)
    return np.stack((np.where(leads & ~even, best, 0.0), np.where(~leads & ~even, best, 0.0)))


def check_with_package(first: Floats, second: Floats, bins: int, alpha: float, studies: int) -> None:
    """End the program if the package decides one of the first studies differently; nothing without the package."""
    if find_spec(PACKAGE) is None:
        return
    from nscore.nonparametric_nsm import MirroredContinuousNsmTest
    from statistical_comparison_core import Decision, Hypothesis

    signs, run = n_score(first[:studies], second[:studies], bins, alpha)
    meaning = {Decision.FailToDecide: 0, Decision.AcceptAlternative: 1, Decision.AcceptNull: -1}
    for place in range(len(signs)):
        test = MirroredContinuousNsmTest(Hypothesis.P0MoreThanP1, alpha, np.linspace(0, 1, bins))
        sign, units = 0, 0
        while not sign and units < first.shape[1]:
            scores = float(first[place, units]), float(second[place, units])
            sign, units = meaning[test.step(*scores).decision], units + 1
        if (sign, units) != (signs[place], run[place]):
            raise SystemExit(
                f"study {place}: the package ends with {sign} after {units}, not {signs[place]}, {run[place]}"
            )
