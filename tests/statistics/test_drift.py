"""The exact test of success against time equals an enumeration of all orders."""

import itertools
import math

import numpy as np
import pytest

from vsnbench.statistics import drift
from vsnbench.statistics.drift import trend


def by_hand(strata: list[list[bool]]) -> float:
    """Enumerate all orders of all strata."""

    def later(outcomes: tuple[bool, ...]) -> int:
        return sum(b and not a for a, b in itertools.combinations(outcomes, 2))

    orders = [[later(one) for one in set(itertools.permutations(each))] for each in strata]
    middle = sum(sum(each) * (len(each) - sum(each)) for each in strata) / 2
    seen = abs(sum(later(tuple(each)) for each in strata) - middle)
    sums = [abs(sum(each) - middle) >= seen for each in itertools.product(*orders)]
    return sum(sums) / len(sums)


@pytest.mark.parametrize(
    "strata",
    [
        [[True, True, False, True, False, False]],
        [[True, False, False], [True, True, False, False, False]],
        [[False, True, True, True], [True, True], [False, True, False]],
    ],
)
def test_the_p_value_is_that_of_counting_every_order(strata: list[list[bool]]) -> None:
    found = trend(strata)
    assert found.exact
    assert found.p == pytest.approx(by_hand(strata))


def test_a_robot_that_wears_out_is_found_and_the_other_way_round_is_as_likely() -> None:
    worn = trend([[True] * 7 + [False] * 8])
    rising = trend([[False] * 8 + [True] * 7])
    assert worn.p == rising.p == worn.least_p == pytest.approx(2 / math.comb(15, 7))
    assert (worn.later, rising.later) == (0.0, 1.0)


def test_what_does_not_vary_says_nothing() -> None:
    for strata in ([], [[True, True], [False]]):
        found = trend(strata)
        assert (found.p, found.least_p) == (1.0, 1.0)
        assert math.isnan(found.later)


def test_few_trials_could_not_have_shown_anything_and_it_says_so() -> None:
    assert trend([[True, False, False]]).least_p > 0.05


def test_it_holds_its_level_and_many_trials_agree_with_the_count(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(3)
    drawn = [[(random.random(15) < 0.3).tolist() for _ in range(3)] for _ in range(400)]
    counted = [trend(strata).p for strata in drawn]
    assert np.mean(np.array(counted) < 0.05) < 0.08
    monkeypatch.setattr(drift, "_MOST_WORK", 0)
    close = [trend(strata) for strata in drawn]
    assert not close[0].exact
    assert max(abs(p - each.p) for p, each in zip(counted, close, strict=True) if math.isfinite(each.later)) < 0.06
