"""Merging a study from several records keeps one schedule, each trial once, and all log entries."""

import shutil
import sqlite3
from pathlib import Path

import pytest

from tests.results.records_of_a_lab import plan, run, stopped
from tests.results.studies_of_a_lab import amend, apply_merge, lock
from vsnbench.errors import RecordError
from vsnbench.interop.merge import MergeResult, merge, merge_source
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.entries import AMEND, LOCK, SESSION, UNBLIND, RecordedStudy, StudyTrialProgress
from vsnbench.results.studies.queries import studies, trials_of
from vsnbench.results.writing.journal import Journal


def record(path: Path) -> Journal:
    path.mkdir(exist_ok=True)
    return Journal.open(sqlite_url(path / "vsnbench.db"))


def merged(into: Path, *others: Path, url: str | None = None) -> MergeResult:
    target = ResultsDirectory.locate(into, url, {})
    return merge(target, [merge_source(str(other)) for other in others], without_images=True)


def found(url: str) -> tuple[RecordedStudy, tuple[StudyTrialProgress, ...]]:
    """Return the only study of a record, with its trials."""
    with open_record(url) as engine:
        (study,) = studies(engine)
        return study, trials_of(engine, study.id)


def scheduled(standing: tuple[StudyTrialProgress, ...]) -> list[tuple[object, ...]]:
    return [(one.rank, one.block, one.arm, one.trial.goal, one.trial.start) for one in standing]


def test_a_study_that_two_places_shared_becomes_one_again(tmp_path: Path, url: str) -> None:
    with record(tmp_path / "ours") as journal:
        study = lock(journal)
        apply_merge(journal, study, range(2))
    shutil.copytree(tmp_path / "ours", tmp_path / "theirs")
    with record(tmp_path / "ours") as journal:
        apply_merge(journal, study, range(2, 5))
        amend(journal, study, "title: Which one?\n")
        journal.note_in_study(study.id, SESSION)
    with record(tmp_path / "theirs") as journal:
        apply_merge(journal, study, range(4, 8))
        journal.unblind_study(study.id, "all is done here")
    told = merged(tmp_path / "all", tmp_path / "ours", tmp_path / "theirs", url=url).plan
    assert (told.studies.new, len(told.new_episodes), told.second_results) == (1, 9, 1)
    assert [one.study["title"] for one in told.studies.revealed] == ["Which?"]
    united, standing = found(url)
    assert [one.rank for one in standing] == list(range(8))
    assert all(one.done for one in standing)
    assert [(one.arm, one.block, one.trial.goal, one.trial.start) for one in standing] == [
        (one.arm, one.block, one.trial.goal, one.trial.start)
        for one in found(sqlite_url(tmp_path / "ours/vsnbench.db"))[1]
    ]
    assert (united.uuid, united.arms[0].code, united.content) == (study.uuid, "A", "title: Which one?\n")
    assert not united.is_blind
    assert [one.kind for one in united.entries] == [LOCK, AMEND, SESSION, UNBLIND]
    assert not merged(tmp_path / "all", tmp_path / "theirs", tmp_path / "ours", url=url).plan.changes


def test_a_plan_locked_twice_merges_and_the_lower_number_of_a_trial_counts(
    tmp_path: Path,
) -> None:
    for name, ranks in (("ours", range(3)), ("theirs", range(2, 6))):
        with record(tmp_path / name) as journal:
            apply_merge(journal, lock(journal), ranks)
    told = merged(tmp_path / "ours", tmp_path / "theirs").plan
    assert (told.studies.new, told.second_results) == (0, 1)
    united, standing = found(sqlite_url(tmp_path / "ours/vsnbench.db"))
    assert [one.done for one in standing] == [True] * 6 + [False] * 2
    assert [one.results for one in standing] == [1, 1, 2, 1, 1, 1, 0, 0]
    assert united.is_blind
    assert [one.kind for one in united.entries] == [LOCK, LOCK]
    with record(tmp_path / "ours") as journal:
        apply_merge(journal, united, range(6, 8))


def test_two_plans_are_not_chosen_between_until_one_is_amended_to_be_the_other(tmp_path: Path) -> None:
    for name in ("ours", "theirs"):
        with record(tmp_path / name) as journal:
            amend(journal, lock(journal), f"title: Which, {name}?\n")
    with pytest.raises(RecordError, match=r"has different amendments in this record and .*theirs") as refused:
        merged(tmp_path / "ours", tmp_path / "theirs")
    assert "lark" not in str(refused.value)
    assert len(found(sqlite_url(tmp_path / "ours/vsnbench.db"))[0].entries) == 2
    with record(tmp_path / "theirs") as journal:
        amend(journal, found(sqlite_url(tmp_path / "theirs/vsnbench.db"))[0], "title: Which, ours?\n")
    merged(tmp_path / "ours", tmp_path / "theirs")
    united, _ = found(sqlite_url(tmp_path / "ours/vsnbench.db"))
    assert (united.content, [one.kind for one in united.entries].count(AMEND)) == ("title: Which, ours?\n", 3)


@pytest.mark.parametrize("where", ["here", "there"])
def test_trials_that_were_run_outside_of_a_study_do_not_come_into_it(tmp_path: Path, where: str) -> None:
    with record(tmp_path / "study") as journal:
        lock(journal)
    with record(tmp_path / "plain") as journal:
        run(journal, journal.find_or_create_campaign(plan(seed=3)).trials[0], stopped(success=True), steps=1)
    mine, other = ("study", "plain") if where == "here" else ("plain", "study")
    with pytest.raises(
        RecordError, match="has 1 episodes of arm B of the study 'Which\\?' that were run outside of it"
    ):
        merged(tmp_path / mine, tmp_path / other)
    with record(tmp_path / "else") as journal:
        run(journal, journal.find_or_create_campaign(plan(seed=4)).trials[0], stopped(success=True), steps=1)
    assert len(merged(tmp_path / "study", tmp_path / "else").plan.new_episodes) == 1


def test_a_plan_that_was_changed_by_hand_does_not_come_in(tmp_path: Path) -> None:
    for change in ("UPDATE study SET content = 'title: Another'", "UPDATE study_trial SET block = 9 - block"):
        shutil.rmtree(tmp_path / "theirs", ignore_errors=True)
        for name in ("ours", "theirs"):
            with record(tmp_path / name) as journal:
                if not studies(journal.engine):
                    lock(journal)
        with sqlite3.connect(tmp_path / "theirs/vsnbench.db") as database:
            database.execute(change)
        database.close()
        with pytest.raises(RecordError, match="edited by hand"):
            merged(tmp_path / "ours", tmp_path / "theirs")
