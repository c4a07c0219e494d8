"""The paper's printed counts, and numbers derived from them."""

import pytest

from tests.report.records import measured
from vsnbench.report.analysis.published import PAPER_INTERVALS, published, published_results
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.report.tables.reference import reference_tables


@pytest.fixture(scope="module")
def models() -> dict[str, ConditionSummary]:
    return {one.condition.model: one for one in published_results().conditions}


@pytest.mark.parametrize(
    ("model", "successes", "episodes", "percent", "low", "high"),
    [("vlv", 22, 75, 29.33, 20.24, 40.44), ("pirlnav", 19, 90, 21.11, 13.95, 30.63)],
)
def test_the_totals_with_their_intervals(
    models: dict[str, ConditionSummary],
    model: str,
    successes: int,
    episodes: int,
    percent: float,
    low: float,
    high: float,
) -> None:
    total = models[model].total
    assert (total.successes, total.episodes) == (successes, episodes)
    assert [round(100 * each, 2) for each in (total.success_rate, total.interval.low, total.interval.high)] == [
        percent,
        low,
        high,
    ]


@pytest.mark.parametrize(
    ("model", "goal", "printed"),
    [
        ("vlv", "chair", (6, 40.0, 30)),
        ("vlv", "sofa", (6, 40.0, 65)),
        ("vlv", "table", (6, 40.0, 42)),
        ("vlv", "bed", (3, 20.0, 39)),
        ("vlv", "toilet", (1, 6.67, 42)),
        ("pirlnav", "chair", (5, 33.33, 49)),
        ("pirlnav", "monitor", (5, 33.33, 91)),
        ("pirlnav", "sofa", (5, 33.33, 70)),
        ("pirlnav", "bed", (3, 20.0, 97)),
        ("pirlnav", "toilet", (1, 6.67, 61)),
        ("pirlnav", "plant", (0, 0.0, 82)),
    ],
)
def test_each_row_as_printed(
    models: dict[str, ConditionSummary], model: str, goal: str, printed: tuple[int, float, float]
) -> None:
    (summary,) = [one for one in models[model].goals if one.goal == goal]
    assert summary.episodes == 15
    assert (summary.successes, round(100 * summary.success_rate, 2), measured(summary, "mean_actions")) == printed


def test_the_four_shared_goals(models: dict[str, ConditionSummary]) -> None:
    for one in published_results().conditions:
        assert one.shared_goals == ("chair", "sofa", "bed", "toilet")
    shared = [models[name].shared for name in ("vlv", "pirlnav")]
    assert [(one.successes, one.episodes) for one in shared if one] == [(16, 60), (14, 60)]


def test_stability_is_38_hours_and_5_22_kilometres() -> None:
    assert (published().hours, published().kilometres) == (38, 5.22)


def test_what_else_is_quoted_as_printed() -> None:
    vlv, pirlnav = published().models
    assert (vlv.virtual_success_percent, pirlnav.virtual_success_percent) == (39, 65)
    assert (vlv.never_succeeding_starts, vlv.once_succeeding_starts) == ((10, 12), (1, 2, 13))
    assert pirlnav.stops is not None
    assert (pirlnav.stops.count, pirlnav.stops.percent) == (31, 0.2)


def test_every_table_with_the_papers_intervals_says_what_they_assume() -> None:
    with_intervals = [table for table in reference_tables() if any("interval" in one.heading for one in table.columns)]
    assert len(with_intervals) == 4
    for table in with_intervals:
        assert any(PAPER_INTERVALS in note for note in table.notes), table.name
