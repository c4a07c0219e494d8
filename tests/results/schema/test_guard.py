"""Readers and writers refuse a database whose schema can run code."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.results.records_of_a_lab import write_success
from tests.shared_records import write_copy
from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_path
from vsnbench.results.merging.sources import open_other
from vsnbench.results.reading.integrity import record_fault
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.schema.migrate import open_record, schema_state, upgrade
from vsnbench.results.writing.journal import Journal

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id FROM n"
FORGED = "PRAGMA writable_schema = ON; UPDATE sqlite_master SET"
SCHEMAS = {
    "view": f"DROP TABLE placement; CREATE VIEW placement AS {ENDLESS}",
    "view in another name": f"CREATE VIEW x AS {ENDLESS}",
    "trigger": "CREATE TRIGGER t AFTER INSERT ON verdict BEGIN UPDATE episode SET state = 'done'; END",
    "virtual table": "CREATE VIRTUAL TABLE v USING fts5(words)",
    "computed column": "ALTER TABLE event ADD COLUMN c AS (upper(text))",
    "index on an expression": "CREATE INDEX e ON event (upper(text))",
    "forged view": f"{FORGED} type = 'table', sql = 'CREATE VIEW site AS {ENDLESS}' WHERE name = 'site'",
    "forged root page": f"{FORGED} rootpage = 0 WHERE name = 'site'",
}


@pytest.fixture
def record(sqlite: str, tmp_path: Path) -> str:
    write_copy(tmp_path, write_success)
    return sqlite


def alter(url: str, script: str) -> None:
    path = sqlite_path(url)
    assert path is not None
    with closing(sqlite3.connect(path)) as database:
        database.executescript(script)


def read(url: str, _scratch: Path) -> None:
    with open_record(url):
        pass


def write(url: str, _scratch: Path) -> None:
    Journal.open(url).close()


def look_at_the_schema(url: str, _scratch: Path) -> None:
    schema_state(open_engine(url, read_only=True))


def bring_up_to_date(url: str, _scratch: Path) -> None:
    upgrade(open_engine(url))


def copy(url: str, scratch: Path) -> None:
    backup(url, scratch / "copy.db")


def merge(url: str, scratch: Path) -> None:
    with open_other(url, "other", scratch):
        pass


WAYS = [read, write, look_at_the_schema, bring_up_to_date, copy, merge]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_that_can_run_code_is_refused_in_a_line(
    record: str, name: str, way: Callable[[str, Path], None], tmp_path: Path
) -> None:
    alter(record, SCHEMAS[name])
    path = sqlite_path(record)
    assert path is not None
    before = path.read_bytes()
    with pytest.raises(RecordError) as refused:
        way(record, tmp_path)
    assert "\n" not in str(refused.value)
    assert path.read_bytes() == before


@pytest.mark.parametrize("way", WAYS)
def test_tables_and_indexes_of_a_lab_s_own_are_accepted(
    record: str, way: Callable[[str, Path], None], tmp_path: Path
) -> None:
    alter(record, "CREATE TABLE notes (id INTEGER PRIMARY KEY, text TEXT UNIQUE); CREATE INDEX own ON trial (goal)")
    way(record, tmp_path)
    assert record_fault(record) == ""
