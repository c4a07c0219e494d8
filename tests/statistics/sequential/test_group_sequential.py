import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.sequential.group_sequential import (
    DRAWS,
    EXACT_UP_TO,
    default_looks,
    earliest_look,
    look_weights,
    sequential_p,
    sequential_signs,
    spent_shares,
)

differences = st.lists(st.sampled_from([0.0, 0.2, 0.4, 0.5, 0.8, 1.0]), min_size=9, max_size=9)


def every_pattern(sizes: list[float]) -> np.ndarray:
    """Return the differences under every sign pattern: the null hypothesis, given their sizes."""
    signs = 1 - 2 * ((np.arange(2 ** len(sizes))[:, None] >> np.arange(len(sizes))) & 1)
    return signs * np.array(sizes)


@given(differences, st.sampled_from([(6, 7, 9), (5, 9), (9,)]), st.floats(0.5, 4))
@settings(max_examples=15)
def test_up_to_every_look_at_most_the_spent_share_of_every_level_is_rejected(
    sizes: list[float], looks: tuple[int, ...], spending: float
) -> None:
    p = sequential_p(every_pattern(sizes), looks, spending)
    assert (np.diff(p, axis=1) <= 1e-12).all()
    for level in (0.005, 0.025, 0.05, 0.2, 0.5):
        assert ((p <= level).mean(0) <= level * np.array(spent_shares(looks, spending)) + 1e-12).all()


def test_the_last_look_uses_nearly_all_of_alpha_and_more_than_a_sum_over_the_looks() -> None:
    looks, sizes = (8, 10, 12), [1.0, 0.6, 0.8, 0.4, 1.0, 0.2, 0.6, 0.8, 0.6, 1.0, 0.4, 0.8]
    p = sequential_p(every_pattern(sizes), looks)
    assert 0.045 < (p[:, -1] <= 0.05).mean() <= 0.05


@given(st.lists(st.integers(-5, 5), min_size=6, max_size=10))
@settings(max_examples=30)
def test_with_one_look_it_is_the_sign_flip_test(values: list[int]) -> None:
    row = np.array(values) / 5
    both = [float(sequential_p([sign * row], (len(row),))[0, 0]) for sign in (1, -1)]
    assert min(1.0, 2 * min(both)) == pytest.approx(min(1.0, sign_flip(row)))


@pytest.mark.parametrize("looks", [(8, 11, 15), (11, 15), (8,)])
@pytest.mark.parametrize("level", [0.005, 0.025, 0.1])
def test_the_fast_decisions_of_simulations_are_those_of_the_p_values(looks: tuple[int, ...], level: float) -> None:
    random = np.random.default_rng(3)
    rows = (random.integers(-3, 4, (60, looks[-1])) + random.choice([-2, 0, 0, 2], (60, 1))) / 5
    found = sequential_signs(rows, looks, level)
    assert ((found > 0) == (sequential_p(rows, looks) <= level)).all()
    assert ((found < 0) == (sequential_p(-rows, looks) <= level)).all()
    assert (found != 0).any() or level < 2.0 ** -looks[-1] * 2


def test_more_positions_than_can_be_counted_are_drawn_and_give_the_same_within_their_error() -> None:
    random = np.random.default_rng(5)
    row = random.normal(0.35, 1.0, EXACT_UP_TO + 1)
    looks = (12, 17, EXACT_UP_TO + 1)
    drawn = sequential_p([row], looks)
    assert sequential_p([row], looks) == pytest.approx(drawn, abs=0)  # a fixed seed
    exact = sequential_p([row[:17]], looks)[0]
    assert drawn[0, :2] == pytest.approx(exact, abs=5 * float(np.sqrt(exact.max() / DRAWS / spent_shares(looks)[0])))


def test_default_looks_are_half_three_quarters_and_all_without_those_that_can_decide_nothing() -> None:
    assert default_looks(15, 0.05) == (8, 11, 15)
    assert default_looks(30, 0.05) == (16, 22, 30)
    assert default_looks(8, 0.05) == (8,)
    assert default_looks(15, 0.05 / 10) == (11, 15)
    assert default_looks(3, 0.05) == (3,)
    assert earliest_look(5, 0.05) is None


def test_weights_of_the_looks_sum_to_one() -> None:
    assert sum(look_weights((8, 11, 15))) == pytest.approx(1)
    assert spent_shares((8, 11, 15), 1.0) == pytest.approx((8 / 15, 11 / 15, 1))
