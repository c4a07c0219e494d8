"""Adjacent rates cover the same goals, or each names its goals."""

import html
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import Report, build
from vsnbench.report.formats.html import html_page
from vsnbench.report.tables.headline import headlines
from vsnbench.report.tables.success import overview_table

GOALS = ("bed", "chair", "sofa")


def report(path: Path, *models: tuple[str, ...]) -> Report:
    """Write a model for each tuple of goals; it succeeds only at chairs."""
    lab = Lab(path)
    for number, goals in enumerate(models):
        lab.write([Attempt(goal, start, success=goal == "chair") for goal in goals for start in range(1, 16)],
                  model=f"m{number}")  # fmt: skip
    return build(lab.url, Selection())


@pytest.mark.parametrize(
    ("models", "label", "counts"),
    [
        ((GOALS, GOALS), "all", ["15/45", "15/45"]),
        ((("chair",), GOALS), "shared", ["15/15", "15/15"]),
        ((("chair", "bed"), ("chair", "sofa")), "shared", ["15/15", "15/15"]),
        ((("bed",), ("chair", "sofa")), "own goals", ["0/15", "15/30"]),
    ],
)
def test_one_rate_of_several_models_is_over_the_same_goals_or_says_so(
    tmp_path: Path, models: tuple[tuple[str, ...], ...], label: str, counts: list[str]
) -> None:
    found = report(tmp_path, *models)
    shown = headlines(found.results.conditions)
    assert shown.label == label
    assert [f"{group.successes}/{group.episodes}" for _, group in shown.by_condition] == counts
    table = overview_table(found.results)
    column = [each.heading for each in table.columns].index(label)
    assert [float(row.cells[column].text) for row in table.rows] == [
        round(100 * group.success_rate, 1) for _, group in shown.by_condition
    ]
    page = html_page(found, found.tables(), [])
    assert f"Success rate over {shown.description}, 95 % interval" in html.unescape(page)
    for (goals, _), count in zip(shown.by_condition, counts, strict=True):
        assert (f"{', '.join(goals)}: {count} episodes" in page) is (label != "all")
