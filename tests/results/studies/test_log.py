"""The log of a study is chained on all databases, with concurrent drivers, and after a merge."""

import shutil
import threading
from pathlib import Path

import pytest

from tests.results.locked_study import integrity, lock_drawn, run_ranks
from tests.results.merging.test_studies import merged, record
from tests.results.records_of_a_lab import run, stopped
from tests.shared_records import write_copy
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.studies.evidence import read_evidence
from vsnbench.results.studies.queries import studies
from vsnbench.results.writing.journal import Journal


def test_drivers_that_run_at_once_append_to_one_chain(url: str) -> None:
    with Journal.open(url) as journal:
        study = lock_drawn(journal)
        standing = journal.study_progress(study.id)

    def drive(own: int) -> None:
        with Journal.open(url) as other:
            for one in standing[own::3]:
                run(other, one.trial, stopped(success=True), steps=1)

    drivers = [threading.Thread(target=drive, args=(own,)) for own in range(3)]
    for driver in drivers:
        driver.start()
    for driver in drivers:
        driver.join(timeout=60)
    with Journal.open(url) as journal:
        log = read_evidence(journal.engine, study.id).log
        assert len(log) == 1 + len(standing)
        assert sorted(len(event.parents) for event in log) == [0, *[1] * len(standing)]
        assert integrity(journal, study.uuid) == integrity(journal, study.uuid, None)
        assert integrity(journal, study.uuid).differences == ()


def write_two_logs(directory: Path) -> None:
    """Lock a study, and let two drivers go on with copies of it, both with rank 4; the second unblinds it."""
    with record(directory / "ours") as journal:
        study = lock_drawn(journal)
        run_ranks(journal, study, range(2))
    shutil.copytree(directory / "ours", directory / "theirs")
    with record(directory / "ours") as journal:
        run_ranks(journal, study, range(2, 5))
    with record(directory / "theirs") as journal:
        run_ranks(journal, study, range(4, 8))
        journal.unblind_study(study.id, "all is done here")


@pytest.mark.parametrize("damage", ["", "DELETE FROM study_event WHERE id = (SELECT MAX(id) FROM study_event)"])
def test_a_merge_unites_two_logs_and_keeps_the_sign_of_a_deleted_event(tmp_path: Path, url: str, damage: str) -> None:
    write_copy(tmp_path, write_two_logs)
    with record(tmp_path / "theirs") as journal:
        if damage:
            with journal.engine.begin() as connection:
                connection.exec_driver_sql(damage)
    merged(tmp_path / "all", tmp_path / "ours", tmp_path / "theirs", url=url)
    with Journal.open(url) as journal:
        (united,) = studies(journal.engine)
        assert bool(integrity(journal, united.uuid).differences) == bool(damage)
        run_ranks(journal, united, range(8, 10))
        assert bool(integrity(journal, united.uuid).differences) == bool(damage)
        if not damage:
            assert max(len(event.parents) for event in read_evidence(journal.engine, united.id).log) == 2
    assert not merged(tmp_path / "all", tmp_path / "theirs", tmp_path / "ours", url=url).plan.changes


def test_a_study_locked_in_two_records_is_whole_after_their_merge(tmp_path: Path) -> None:
    for name, ranks in (("ours", range(3)), ("theirs", range(2, 6))):
        with record(tmp_path / name) as journal:
            run_ranks(journal, lock_drawn(journal), ranks)
    merged(tmp_path / "ours", tmp_path / "theirs")
    with Journal.open(sqlite_url(tmp_path / "ours/vsnbench.db")) as journal:
        (united,) = studies(journal.engine)
        assert integrity(journal, united.uuid).differences == ()
        assert integrity(journal, united.uuid).remarks == ()
