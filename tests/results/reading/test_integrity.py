import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.results.records_of_a_lab import plan, run, stopped, write_success
from tests.shared_records import write_copy
from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_path
from vsnbench.results.reading.integrity import record_fault
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def record(sqlite: str, tmp_path: Path) -> str:
    write_copy(tmp_path, write_success)
    return sqlite


def change(url: str, statement: str) -> None:
    path = sqlite_path(url)
    assert path is not None
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("PRAGMA ignore_check_constraints = ON")
        database.execute(statement)


def read(url: str) -> None:
    with open_record(url) as engine:
        episode_record(engine, 1)


def write(url: str) -> None:
    Journal.open(url).close()


def test_a_record_of_ours_has_no_fault(url: str) -> None:
    with Journal.open(url) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
    assert record_fault(url) == ""


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE step SET action = 'JUMP'", "step 1/1: action is 'JUMP', not one of STOP"),
        ("UPDATE episode SET started_at = 'soon'", "episode 1: started_at is 'soon', not a valid time"),
        (
            "UPDATE episode SET started_at = '0001-01-01 00:00:00'",
            "started_at is datetime.datetime(1, 1, 1, 0, 0), not a valid time",
        ),
        ("UPDATE episode SET path_length_m = 9e999", "path_length_m is inf, not a plausible number"),
        ("UPDATE trial SET start = 'a' WHERE id = 1", "start is 'a', not an integer"),
        ("UPDATE site SET content = '{'", "content is '{', not valid JSON"),
        ("UPDATE campaign SET protocol = '{\"max_actions\": -1}'", "protocol is invalid"),
        ("UPDATE trial SET campaign_id = 99", "refers to a missing row of campaign"),
    ],
)
def test_what_no_vsnbench_writes_is_named_with_its_row(record: str, statement: str, said: str) -> None:
    change(record, statement)
    assert said in record_fault(record)


@pytest.mark.parametrize(
    "word", [b"CREATE TABLE step", b"UNIQUE (uuid)", b"raw_action", b"sqlite_autoindex_site_1", b"'claimed'"]
)
@pytest.mark.parametrize("opened", [read, write])
def test_a_schema_that_is_not_utf_8_is_a_damaged_record(
    record: str, word: bytes, opened: Callable[[str], None]
) -> None:
    path = sqlite_path(record)
    assert path is not None
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = DELETE")
    content = path.read_bytes()
    assert word in content
    path.write_bytes(content.replace(word, bytes(byte | 0x80 for byte in word)))
    with pytest.raises(RecordError) as refused:
        opened(record)
    assert "\n" not in str(refused.value)
    assert refused.value.advice
