import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import select

from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.errors import RecordError, UsageError
from vsnbench.results.database_url import redacted_url, sqlite_path, sqlite_url
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.schema import engine as engine_module
from vsnbench.results.schema.engine import open_engine, opened_engine, to_json
from vsnbench.results.schema.migrate import create_record, open_record
from vsnbench.results.schema.tables import EpisodeRow
from vsnbench.results.writing.journal import Journal

WRITER_ON_A_FULL_DISK = """
import resource, sys
from tests.results.records_of_a_lab import begun, forward, plan
from vsnbench.results.writing.journal import Journal
from vsnbench.errors import RecordError

journal = Journal.open(sys.argv[1])
trial = journal.find_or_create_campaign(plan()).trials[0]
episode = begun(journal, trial)
resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, 600_000))
for number in range(1, 100_000):
    try:
        journal.append_step(episode.id, forward(number))
    except RecordError as error:
        print(number - 1, error, sep="|")
        break
"""


def test_a_full_disk_is_one_clear_line_and_what_was_committed_stays(sqlite: str) -> None:
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", WRITER_ON_A_FULL_DISK, sqlite],
        capture_output=True,
        text=True,
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        check=True,
    )
    committed, line = done.stdout.strip().split("|")
    assert "free some space" in line or "free space" in line
    assert "\n" not in line
    with Journal.open(sqlite) as journal:
        assert [episode.steps for episode in journal.recovered] == [int(committed)]


def test_a_directory_that_is_not_there_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"cannot use the database .*nowhere/vsnbench\.db: unable to open"):
        Journal.open(sqlite_url(tmp_path / "nowhere" / "vsnbench.db"))


def test_a_file_that_is_no_database_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "vsnbench.db").write_text("a shopping list, long enough to be read as the head of a file" * 20)
    with pytest.raises(RecordError, match=r"is not a database; .*choose another"):
        Journal.open(sqlite_url(tmp_path / "vsnbench.db"))


def test_a_server_that_is_not_there_is_one_clear_line() -> None:
    with pytest.raises(RecordError, match="does not answer") as caught:
        Journal.open("postgresql+psycopg://lab:secret@127.0.0.1:1/results?connect_timeout=2")
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("url", ["nonsense", "foo://x/y"])
def test_a_url_that_is_none_is_a_mistake_of_the_command(url: str) -> None:
    with pytest.raises(UsageError):
        open_engine(url)


def test_a_reader_makes_no_file_and_can_change_nothing(tmp_path: Path, sqlite: str) -> None:
    with pytest.raises(RecordError, match="no record"):
        open_record(sqlite).__enter__()
    assert list(tmp_path.iterdir()) == []
    Journal.open(sqlite).close()
    with open_record(sqlite) as engine, pytest.raises(Exception, match="readonly"), engine.begin() as connection:
        connection.exec_driver_sql("DELETE FROM campaign")


READER_WITHOUT_RIGHTS = """
import os, sys
from vsnbench.results.schema.migrate import create_record, open_record
from vsnbench.results.schema.tables import EpisodeRow
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.reading.filtering import EpisodeFilter

def episodes():
    with open_record(sys.argv[1]) as engine:
        return len(list_episodes(engine, EpisodeFilter()))

assert episodes() == 1
if os.getuid() == 0:  # root may write everywhere
    os.setgroups([])
    os.setuid(65534)
try:
    open(sys.argv[2] + "/probe", "w")
except PermissionError:
    print(episodes())
"""


def test_an_archive_that_cannot_be_written_can_be_read() -> None:
    archive = Path(tempfile.mkdtemp(prefix="vsnbench-archive-", dir="/tmp"))
    url = sqlite_url(archive / "vsnbench.db")
    try:
        with Journal.open(url) as journal:
            run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
        archive.chmod(0o555)
        (archive / "vsnbench.db").chmod(0o444)
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
        done = subprocess.run(
            [sys.executable, "-c", READER_WITHOUT_RIGHTS, url, str(archive)],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert (done.stdout.strip(), done.stderr) == ("1", "")
        assert [path.name for path in archive.iterdir()] == ["vsnbench.db"]
    finally:
        archive.chmod(0o755)
        shutil.rmtree(archive)


def test_a_password_is_never_shown() -> None:
    assert "secret" not in redacted_url("postgresql+psycopg://lab:secret@host/results")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(json_values)
@settings(deadline=None)
def test_whatever_a_model_reports_becomes_strict_json(value: object) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    json.loads(to_json(value), parse_constant=refuse)


def test_a_listing_is_two_queries_however_many_episodes(sqlite: str) -> None:
    """One for the episodes, one for the tags of 500 of them."""
    with Journal.open(sqlite) as journal:
        for trial in journal.find_or_create_campaign(plan()).trials:
            run(journal, trial, stopped(success=True))
        queries: list[str] = []
        from sqlalchemy import event

        event.listen(journal.engine, "before_cursor_execute", lambda *words: queries.append(words[2]))
        list_episodes(journal.engine, EpisodeFilter())
        assert len([query for query in queries if query.startswith("SELECT")]) == 2


def test_a_writer_waits_for_another_one_as_long_as_it_takes_and_says_so(
    sqlite: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine_module, "BUSY_TIMEOUT_S", 0.05)
    with Journal.open(sqlite) as journal, ThreadPoolExecutor(1) as pool:
        campaign = journal.find_or_create_campaign(plan())
        path = sqlite_path(sqlite)
        assert path is not None
        with closing(sqlite3.connect(path, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            claim = pool.submit(journal.claim_next, campaign.id, [campaign.trials[0].id])
            deadline = time.monotonic() + 20
            while "waiting for another process" not in caplog.text and time.monotonic() < deadline:
                with pytest.raises(TimeoutError):
                    claim.result(0.05)
            with pytest.raises(TimeoutError):  # it still waits after many time-outs of SQLite
                claim.result(0.5)
            other.execute("COMMIT")
        done = claim.result(20)
        assert done is not None
        assert done.trial == campaign.trials[0]
    assert "has ended" in caplog.text


def test_a_record_without_a_referenced_model_is_refused(sqlite: str) -> None:
    with Journal.open(sqlite) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
    path = sqlite_path(sqlite)
    assert path is not None
    with closing(sqlite3.connect(path)) as database:
        database.execute("DELETE FROM model")
        database.commit()
    with pytest.raises(RecordError, match="the model of campaign 1 is missing"):
        open_record(sqlite).__enter__()


def test_what_is_compiled_for_one_file_serves_another(tmp_path: Path) -> None:
    compiled = []
    for url in (sqlite_url(tmp_path / f"{name}.db") for name in ("one", "other")):
        create_record(url)
        with opened_engine(url, read_only=True) as engine, engine.connect() as connection:
            compiled.append(connection.execute(select(EpisodeRow.id)).context.compiled)
    assert compiled[0] is compiled[1]
