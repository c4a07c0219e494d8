"""Comparison with the paper's results covers only the same goals."""

from tests.report.records import Attempt, Lab
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.table import UNKNOWN
from vsnbench.report.tables.reference import paper_comparison_table


def rows_of(lab: Lab) -> dict[tuple[str, str], list[str]]:
    table = paper_comparison_table(summarise(read(lab.url, Selection())))
    return {(row.cells[0].text, row.cells[2].text): [cell.text for cell in row.cells] for row in table.rows}


def test_a_mean_over_three_goals_is_not_laid_beside_one_over_five(lab: Lab) -> None:
    lab.write([Attempt(goal, start) for goal in ("chair", "bed", "plant") for start in range(1, 16)], model="vlv")
    rows = rows_of(lab)
    assert rows["all", "simulated, apartment"][-2:] == [UNKNOWN, UNKNOWN]
    shared = rows["shared: chair, bed", "simulated, apartment"]
    assert (shared[3], shared[-2]) == ("30/30", "70.00")  # the paper's 6/15 and 3/15
    theirs = [row for (goal, where), row in rows.items() if goal == "shared: chair, bed" and where.startswith("real")]
    assert [row[3] for row in theirs] == ["9/30"]


def test_the_same_goals_are_compared_in_their_total(lab: Lab) -> None:
    goals = ("chair", "sofa", "table", "bed", "toilet")
    lab.write([Attempt(goal, start) for goal in goals for start in range(1, 16)], model="vlv")
    rows = rows_of(lab)
    assert rows["all", "simulated, apartment"][-2] == "70.67"  # 75/75 less 22/75
    assert not any(goal.startswith("shared") for goal, _ in rows)
