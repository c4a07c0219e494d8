"""Small finite plans are tried in all orders, so coverage is counted, not sampled."""

import itertools
from fractions import Fraction

import numpy as np
import pytest

from vsnbench.statistics.sequential.betting import FRACTIONS, MEAN_FRACTIONS, as_share, capital, p_values, sequence

PLANS = [
    pytest.param(values, id="".join(str(round(2 * value)) for value in values))
    for size in (3, 5, 6)
    for values in itertools.combinations_with_replacement((0.0, 0.5, 1.0), size)
]


@pytest.mark.parametrize("plan", PLANS)
def test_the_true_mean_of_a_plan_is_bet_away_in_few_of_its_orders(plan: tuple[float, ...]) -> None:
    orders = np.array(list(itertools.permutations(plan)))
    ever = capital(orders, np.mean(plan), len(plan))[:, -1]
    for alpha in (0.05, 0.1, 0.2, 0.5):
        assert np.mean(ever >= 1 / alpha) <= alpha


@pytest.mark.parametrize("size", [4, 6])
def test_the_sequence_covers_the_mean_at_every_look_of_every_order(size: int) -> None:
    for plan in itertools.combinations_with_replacement((0.0, 0.5, 1.0), size):
        orders = sorted(set(itertools.permutations(plan)))
        missed = 0
        for order in orders:
            low, high = sequence(order, size, alpha=0.2)
            missed += bool(np.any(np.mean(plan) < low - 1e-9) or np.any(np.mean(plan) > high + 1e-9))
        assert missed <= 0.2 * len(orders)


def test_the_confidence_sequence_covers_the_mean_of_values_and_converges() -> None:
    random = np.random.default_rng(0)
    missed = 0
    for _ in range(300):
        values = random.beta(0.5, 0.5, 24).round(3)
        low, high = sequence(values, len(values), alpha=0.2, steps=None)
        missed += bool((values.mean() < low).any() or (values.mean() > high).any())
        assert high[-1] - low[-1] < high[0] - low[0]
    assert missed <= 0.2 * 300


def test_a_mean_that_the_rest_of_the_plan_cannot_reach_is_ruled_out_for_certain() -> None:
    above, below = p_values([1.0, 1.0, 1.0], 0.5, size=5)
    assert above[-1] < 1
    above, _ = p_values([1.0, 1.0, 1.0, 1.0], 0.5, size=5)
    assert above[-1] == 0
    assert below[-1] == 1


def test_the_sequence_only_narrows_to_the_mean_of_the_whole_plan() -> None:
    rng = np.random.default_rng(3)
    values = rng.choice([0.0, 0.5, 1.0], 40, p=[0.2, 0.3, 0.5])
    low, high = sequence(values, 40, alpha=0.05)
    assert np.all(np.diff(low) >= 0)
    assert np.all(np.diff(high) <= 0)
    assert low[-1] <= values.mean() <= high[-1]
    assert high[-1] - low[-1] < 0.1


def test_draws_without_replacement_tell_more_than_draws_with() -> None:
    rng = np.random.default_rng(0)
    won = (rng.random((300, 75)) < 0.8).astype(float) - (rng.random((300, 75)) < 0.6)
    without, with_replacement = (np.minimum(1, 1 / capital(as_share(won), 0.5, size)) for size in (75, None))
    blocks = [np.where(p <= 0.025, np.arange(1, 76), 75).min(axis=1).mean() for p in (without, with_replacement)]
    assert blocks[0] < 0.9 * blocks[1]


def test_with_replacement_a_true_mean_survives_every_look() -> None:
    rng = np.random.default_rng(5)
    values = (rng.random((4000, 100)) < 0.6).astype(float)
    assert np.mean(capital(values, 0.6, None)[:, -1] >= 20) <= 0.05


def test_more_values_than_the_plan_has_are_refused() -> None:
    with pytest.raises(ValueError, match="4 values cannot come from a plan of 3"):
        capital([1.0, 0.0, 1.0, 1.0], 0.5, 3)


def ruled_out(values: list[float], mean: Fraction, size: int, alpha: float) -> list[bool]:
    """Return after each value whether a bet on a greater mean has won, by definition, in fractions.

    The gambler bets a share of the capital on "the next value exceeds its expectation". The capital is multiplied by 1
    minus the share, plus share times value / expectation. The expectation is the required mean of the remaining values.
    """
    purses = [Fraction(1, len(FRACTIONS)) for _ in FRACTIONS]
    rest, won, told = mean * size, False, []
    for drawn, value in enumerate(map(Fraction, values)):
        expected = rest / (size - drawn)
        won = won or expected < 0 or (expected == 0 and value > 0)
        if not won and expected > 0:
            bets = zip(purses, (Fraction(str(share)) for share in FRACTIONS), strict=True)
            purses = [purse * (1 - share + share * value / expected) for purse, share in bets]
        rest -= value
        won = won or sum(purses) >= Fraction(2) / Fraction(str(alpha))
        told.append(won)
    return told


def test_the_sequence_is_that_of_an_implementation_in_fractions() -> None:
    random = np.random.default_rng(8)
    for size, seen in ((9, 9), (12, 7)):
        values = random.choice([0.0, 0.5, 1.0], seen, p=[0.1, 0.3, 0.6]).tolist()
        low, high = sequence(values, size, alpha=0.3)
        means = [Fraction(part, 2 * size) for part in range(2 * size + 1)]
        too_low = [ruled_out(values, mean, size, 0.3) for mean in means]
        too_high = [ruled_out([1 - value for value in values], 1 - mean, size, 0.3) for mean in means]
        for look in range(seen):
            kept = [mean for mean, out in zip(means, too_low, strict=True) if not out[look]]
            assert float(min(kept)) == pytest.approx(low[look])
            kept = [mean for mean, out in zip(means, too_high, strict=True) if not out[look]]
            assert float(max(kept)) == pytest.approx(high[look])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("fractions", [FRACTIONS, MEAN_FRACTIONS])
@pytest.mark.parametrize("size", [None, 400])
def test_hundreds_of_wins_overflow_nothing(size: int | None, fractions: np.ndarray) -> None:
    wins = np.ones(400)
    low, high = sequence(wins, size, 0.05, fractions=fractions)
    assert low[-1] > 0.95
    assert high[-1] == 1
    above, below = p_values(wins, 0.001, None, fractions)
    assert 0 < above[-1] < 1e-100
    assert below[-1] == 1


def test_larger_bets_on_means_keep_the_level_too() -> None:
    rng = np.random.default_rng(8)
    rare = (rng.random((4000, 60)) < 0.05).astype(float)
    for values, mean in ((rng.beta(0.3, 0.7, (4000, 60)), 0.3), (rare, 0.05)):
        assert np.mean(capital(values, mean, None, MEAN_FRACTIONS)[:, -1] >= 20) <= 0.05
        assert np.mean(capital(1 - values, 1 - mean, None, MEAN_FRACTIONS)[:, -1] >= 20) <= 0.05
