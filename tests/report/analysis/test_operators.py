"""Operators and their judgements, in records with known results."""

import json
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import Report, build
from vsnbench.report.formats.json import to_json
from vsnbench.report.tables.operators import operator_table
from vsnbench.results.writing.entries import INTERVENTION


def judged(lab: Lab, numbers: list[int], author: str, *, overruled: int = 0) -> None:
    """Let a person confirm successful episodes, and overrule some of them."""
    with lab.journal() as journal:
        for place, number in enumerate(numbers):
            wrong = place < overruled
            reason = EndReason.COLLISION if wrong else EndReason.STOP
            journal.judge(number, Verdict(reason, not wrong, "as seen"), author=author)


@pytest.fixture
def two_people(tmp_path: Path) -> Lab:
    """Anna ran and judged eight trials, Ben eight; Ben overruled three and intervened once."""
    lab = Lab(tmp_path)
    people = [("Anna", start) for start in range(1, 9)] + [("Ben", start) for start in range(9, 16)]
    numbers = lab.write([Attempt(start=start, operator=who) for who, start in people], simulated=False)
    judged(lab, numbers[:8], "Anna")
    judged(lab, numbers[8:], "Ben", overruled=3)
    with lab.journal() as journal:
        journal.add_event(INTERVENTION, "taken off the carpet", author="Ben", episode_id=numbers[9])
    return lab


def report_of(lab: Lab, *, whole: bool = True) -> Report:
    return build(lab.url, Selection(), activity=whole)


def test_who_judged_with_how_many_successes_overruled_and_interventions(two_people: Lab) -> None:
    found = report_of(two_people).operator_activity
    assert found is not None
    anna, ben = found["operators"]
    assert [tuple(one[key] for key in ("name", "sessions", "overruled", "interventions")) for one in (anna, ben)] == [
        ("Anna", 1, 0, 0),
        ("Ben", 1, 3, 1),
    ]
    assert [(judged.successes, judged.trials) for judged in (one["judged"].proportion for one in (anna, ben))] == [
        (8, 8),
        (4, 7),
    ]
    assert (anna["p"], ben["p"]) == pytest.approx((0.0769, 0.0769), abs=1e-4)  # Fisher of 8/8 against 4/7
    assert [(one["operator"], one["attempts"], one["interventions"]) for one in found["sessions"]] == [
        ("Anna", 8, 0),
        ("Ben", 7, 1),
    ]
    assert [cell.text for cell in operator_table(found).rows[1].cells][1] == "4/7"


def test_two_sessions_are_told_of_unasked_and_time_is_tested_over_both(two_people: Lab) -> None:
    tables = {table.name: table for table in report_of(two_people, whole=False).tables()}
    names = list(tables)
    for name in ("operators", "sessions"):
        first = [column.heading for column in tables[name].columns[:4]]
        assert "SR %" in first, "a phone shows the answer without scrolling"
    assert names[-3:] == ["operators", "sessions", "drift"]
    report = report_of(two_people)
    said = json.loads(
        to_json(report.results, report.questions, report.activity, report.record, report.operator_activity)
    )
    assert [one["name"] for one in said["operator_activity"]["operators"]] == ["Anna", "Ben"]
    over = said["models"][0]["sensitivity"]["drift_over_all_sessions"]
    # Three failures of fifteen, all among the last seven: the ninth, tenth and eleventh.
    assert (over["exact"], over["p"] < 1, len(over["thirds"])) == (True, True, 3)


def test_nothing_is_said_of_one_person_in_one_session(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    judged(lab, lab.write([Attempt(start=start, operator="Anna") for start in range(1, 16)], simulated=False), "Anna")
    report = report_of(lab)
    assert report.operator_activity is None
    assert {"operators", "sessions"}.isdisjoint(table.name for table in report.tables(long=True))
