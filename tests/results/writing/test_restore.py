"""Restoring a backup: checked first, keeps the current database, refused during a run."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.results.records_of_a_lab import plan, run, running_elsewhere, stopped
from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.schema.backup import backup
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.restore import restore


def add(url: str, trial: int) -> None:
    with Journal.open(url) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[trial], stopped(success=True), steps=1)


def count(url: str) -> int:
    with Journal.open(url) as journal:
        return len(list_episodes(journal.engine, EpisodeFilter()))


def test_a_backup_comes_back_and_what_was_there_is_kept(tmp_path: Path, url: str) -> None:
    add(url, 0)
    backup(url, tmp_path / "monday")
    add(url, 1)
    kept = restore(url, tmp_path / "monday", tmp_path)
    assert count(url) == 1
    add(url, 2)
    assert kept is not None
    restore(url, kept, tmp_path)
    assert count(url) == 2


def test_a_backup_makes_a_database_where_there_is_none(tmp_path: Path, sqlite: str) -> None:
    add(sqlite, 0)
    backup(sqlite, tmp_path / "monday")
    other = sqlite_url(tmp_path / "new" / "vsnbench.db")
    assert restore(other, tmp_path / "monday", tmp_path) is None
    assert count(other) == 1


@pytest.mark.parametrize("content", [b"", b"not a database", None, b"half"], ids=["empty", "text", "absent", "half"])
def test_what_is_not_a_whole_backup_is_refused_and_changes_nothing(
    tmp_path: Path, sqlite: str, content: bytes | None
) -> None:
    add(sqlite, 0)
    source = tmp_path / "monday"
    if content == b"half":
        backup(sqlite, source)
        content = source.read_bytes()[: source.stat().st_size // 2]
    if content is not None:
        source.write_bytes(content)
    with pytest.raises(RecordError):
        restore(sqlite, source, tmp_path)
    assert count(sqlite) == 1
    assert not list(tmp_path.glob("before-restore-*"))


def test_a_database_that_a_run_writes_is_not_replaced(tmp_path: Path, url: str) -> None:
    add(url, 3)
    backup(url, tmp_path / "monday")
    with running_elsewhere(url) as process:
        assert process.stdout.readline()
        with pytest.raises(RecordError, match=f"process {process.pid} on"):
            restore(url, tmp_path / "monday", tmp_path)
    assert not list(tmp_path.glob("before-restore-*"))


def give_a_view(file: Path) -> None:
    with closing(sqlite3.connect(file)) as database:
        database.executescript("ALTER TABLE site RENAME TO hidden; CREATE VIEW site AS SELECT * FROM hidden;")


def give_a_trigger(file: Path) -> None:
    with closing(sqlite3.connect(file)) as database:
        database.execute("CREATE TRIGGER t AFTER UPDATE ON episode BEGIN UPDATE episode SET success = 1; END")


def overwrite(file: Path) -> None:
    file.write_bytes(b"not a database" * 1000)


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


@pytest.mark.parametrize("spoil", [give_a_view, give_a_trigger, overwrite, cut])
def test_a_backup_replaces_a_database_that_no_command_opens(
    tmp_path: Path, sqlite: str, spoil: Callable[[Path], None]
) -> None:
    add(sqlite, 0)
    backup(sqlite, tmp_path / "monday")
    file = sqlite_path(sqlite)
    assert file is not None
    spoil(file)
    spoiled = file.read_bytes()
    kept = restore(sqlite, tmp_path / "monday", tmp_path)
    assert count(sqlite) == 1
    assert kept is not None
    assert kept.read_bytes() == spoiled
