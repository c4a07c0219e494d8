"""docs/schema.md is current, and its queries run and agree with the report."""

import sqlite3
from contextlib import closing

import pytest

from scripts.schema_page import PAGE, QUERIES, schema_page
from tests.report.records import Attempt, Lab, step, void
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.results.schema.base import TableBase
from vsnbench.values.movement import Action


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A record of void, judged and retracted attempts; not to be changed."""
    lab = Lab(tmp_path_factory.mktemp("lab"))
    taken = [step(1, Action.MOVE_FORWARD, "LOOK_DOWN", x_m=0.25), step(2, Action.STOP, x_m=0.25)]
    lab.write(
        [
            void(),
            Attempt(steps=taken),
            Attempt("bed", success=False, distance_m=1.2),
            Attempt("bed", 2),
            Attempt("bed", 3),
        ]
    )
    with lab.journal() as journal:
        journal.judge(4, Verdict(EndReason.COLLISION, False, "it touched the bed"), author="Ana")
        journal.retract_verdict(5, author="Ana", seen=1)
    return lab


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == schema_page(), "run `make docs`"


def test_every_column_is_on_the_page() -> None:
    text = schema_page()
    for table in TableBase.metadata.sorted_tables:
        section = text.split(f"\n## {table.name}\n")[1].split("\n## ")[0]
        assert [f"| {column.name} |" in section for column in table.columns] == [True] * len(table.columns)


@pytest.mark.parametrize(("title", "query"), QUERIES)
def test_each_query_runs(lab: Lab, title: str, query: str) -> None:
    with closing(sqlite3.connect(lab.directory / "vsnbench.db")) as database:
        database.execute(query).fetchall()


def ask(lab: Lab, words: str) -> list[tuple[object, ...]]:
    (query,) = [query for title, query in QUERIES if title.startswith(words)]
    with closing(sqlite3.connect(lab.directory / "vsnbench.db")) as database:
        return database.execute(query).fetchall()


def test_the_queries_agree_with_the_report(lab: Lab) -> None:
    record = read(lab.url, Selection())
    (one,) = summarise(record).conditions
    by_goal = {goal.goal: (goal.successes, goal.episodes) for goal in one.goals}
    assert {goal: (k, n) for _, goal, k, n, _ in ask(lab, "Success rate")} == by_goal
    assert tuple(start for _, start in ask(lab, "Starting positions")) == one.never_succeeding
    ends = record.episodes["end_reason"].value_counts().to_dict()
    assert {reason: count for _, reason, count in ask(lab, "How episodes ended")} == ends
    assert ask(lab, "Trials left") == []
    assert len(ask(lab, "All verdicts of episodes with more")) == 2
    assert [row[0] for row in ask(lab, "Near misses")] == [3]
