"""Studies of a verified record: lock, schedule, log, and no trial after the stopping rule."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.evidence.verification.conftest import change
from tests.results.locked_study import lock_drawn, note_of, run_ranks
from tests.results.records_of_a_lab import run, stopped
from tests.study.studies import study_text
from vsnbench.evidence.verification.checks import Check
from vsnbench.evidence.verification.record import open_copy
from vsnbench.evidence.verification.studies import check_studies
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.studies.entries import OVER, RecordedStudy
from vsnbench.results.writing.journal import Journal
from vsnbench.study.lock import LockNote

DECIDED = study_text(stopping="decided", about="these-cells")


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as opened:
        yield opened


def checked(results: Path, note: LockNote | None = None) -> Check:
    scratch = results / "scratch"
    scratch.mkdir()
    with open_copy(results, scratch) as record:
        return check_studies(record, note, lambda _what, _done, _of: None)


def run_one_sided(journal: Journal, study: RecordedStudy, trials: int) -> None:
    """Run trials in which one arm always succeeds and the other always fails."""
    for trial in journal.study_progress(study.id)[:trials]:
        run(journal, trial.trial, stopped(success=trial.arm == study.arms[0].name), steps=1)


def test_a_study_that_was_run_as_planned_holds(journal: Journal, tmp_path: Path) -> None:
    study = lock_drawn(journal)
    run_ranks(journal, study, range(16))
    check = checked(tmp_path, note_of(journal, study))
    assert (check.checked, check.findings) == (1, [])


def test_a_verdict_and_a_plan_that_were_changed_by_hand_are_named(journal: Journal, tmp_path: Path) -> None:
    run_ranks(journal, lock_drawn(journal), range(4))
    change(tmp_path, "UPDATE verdict SET success = 1 - success WHERE id = 2", "UPDATE study SET seed = 8")
    lines = [str(finding) for finding in checked(tmp_path).findings]
    assert [line for line in lines if line.startswith("study 1: verdict 1 of episode #2") and "success" in line]
    assert [line for line in lines if line.startswith("study 1: seed was 7 in the plan and is 8")]


def test_trials_after_the_end_of_a_sequential_study_are_named(journal: Journal, tmp_path: Path) -> None:
    run_one_sided(journal, lock_drawn(journal, DECIDED), 16)
    lines = [str(finding) for finding in checked(tmp_path).findings]
    assert lines
    assert all("began after the study was over (the primary analysis is decided)" in line for line in lines)
    assert lines[-1].startswith("study 1: trial 16 ")


def test_an_end_that_the_results_do_not_support_is_named(journal: Journal, tmp_path: Path) -> None:
    study = lock_drawn(journal, DECIDED)
    run_one_sided(journal, study, 2)
    journal.note_in_study(study.id, OVER, "the primary analysis is decided")
    (line,) = [str(finding) for finding in checked(tmp_path).findings]
    assert line == "study 1: it ended because 'the primary analysis is decided'; its results give 'no end'"
