"""Corrections, letters and ranks equal their definitions, by brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.statistics.multiple import Ranks, holm, letters, ranks


def by_definition(p_values: list[float]) -> list[float]:
    """Return Holm's adjusted p-values by the closed test: the largest Bonferroni value of all sets with it."""
    everyone = range(len(p_values))
    sets = [s for size in range(1, len(p_values) + 1) for s in itertools.combinations(everyone, size)]
    return [max(min(1.0, len(s) * min(p_values[i] for i in s)) for s in sets if one in s) for one in everyone]


def test_holm_closes_the_family_of_bonferroni() -> None:
    random = np.random.default_rng(3)
    for size in (1, 2, 5, 8):
        p_values = (random.random(size) ** 3).tolist()
        assert holm(p_values) == pytest.approx(by_definition(p_values))
    assert holm([]) == ()


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_lowers_a_p_value_and_keeps_their_order(p_values: list[float]) -> None:
    adjusted = holm(p_values)
    assert all(p <= after <= 1 for p, after in zip(p_values, adjusted, strict=True))
    by_p = sorted(range(len(p_values)), key=lambda index: p_values[index])
    assert [adjusted[index] for index in by_p] == sorted(adjusted)


@settings(deadline=None)
@given(st.integers(1, 6), st.randoms(use_true_random=False))
def test_two_models_share_a_letter_exactly_when_they_cannot_be_told_apart(models: int, random: object) -> None:
    pairs = list(itertools.combinations(range(models), 2))
    differ = {pair for pair in pairs if random.random() < 0.5}  # type: ignore[attr-defined]
    shown = letters(models, lambda i, j: (i, j) in differ)
    for i, j in pairs:
        assert bool(set(shown[i]) & set(shown[j])) == ((i, j) not in differ)
    assert all(shown)


def test_letters_of_an_example() -> None:
    # A differs only from C: A and B share a letter, B and C another.
    assert letters(3, lambda i, j: (i, j) == (0, 2)) == ("a", "ab", "b")
    assert letters(3, lambda _i, _j: False) == ("a", "a", "a")


def test_ranks_are_what_the_pairs_leave_open() -> None:
    assert ranks(3, lambda i, j: (i, j) == (0, 2)) == (Ranks(1, 2), Ranks(1, 3), Ranks(2, 3))
    assert ranks(3, lambda i, j: i < j) == (Ranks(1, 1), Ranks(2, 2), Ranks(3, 3))
