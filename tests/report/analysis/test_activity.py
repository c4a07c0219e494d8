"""Activity of a record: sums independent of order, and time shared by several workers."""

from datetime import UTC, datetime, timedelta
from itertools import permutations

import pandas as pd
import pytest

from vsnbench.report.analysis.activity import _total, _waited_s
from vsnbench.report.tables.success import ordered_mean

NOON = datetime(2026, 3, 2, 12, tzinfo=UTC)


def moments(*minutes: float) -> "pd.Series[pd.Timestamp]":
    return pd.Series([pd.Timestamp(NOON + timedelta(minutes=each)) for each in minutes])


@pytest.mark.parametrize(
    ("begins", "ends", "waited_min"),
    [
        ([0], [10], 10),
        ([0, 20], [10, 25], 15),  # two sessions
        ([0, 1], [10, 9], 10),  # two workers
        ([5, 0, 1], [12, 10, 9], 12),
        ([0, 10], [10, 20], 20),
    ],
)
def test_what_ran_at_once_was_waited_for_once(begins: list[float], ends: list[float], waited_min: float) -> None:
    assert _waited_s(moments(*begins), moments(*ends)) == waited_min * 60


def test_sums_and_means_are_the_same_to_the_bit_in_any_order() -> None:
    numbers = [0.1, 1e9, 0.7, 1 / 3, 2e-7]
    orders = [pd.Series(order) for order in permutations(numbers)]
    assert len({order.sum() for order in orders}) > 1
    assert len({_total(order) for order in orders}) == 1
    assert len({ordered_mean(order.to_numpy()) for order in orders}) == 1
