"""Digests of rows name each changed, added and removed row, and the changed column."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from vsnbench.bundle.row_digests import changed_rows, write_row_digests
from vsnbench.errors import RecordError

CONTENT = """
CREATE TABLE step (episode INTEGER, number INTEGER, x REAL, action TEXT, image BLOB, PRIMARY KEY (episode, number))
WITHOUT ROWID;
CREATE TABLE numbered (id INTEGER PRIMARY KEY AUTOINCREMENT, text TEXT);
INSERT INTO step VALUES (1, 1, 0.1, 'STOP', x'00ff'), (1, 2, NULL, 'é', NULL), (2, 1, 1.0, '', x'');
INSERT INTO numbered (text) VALUES ('a'), ('b'), ('b');
"""


@pytest.fixture
def database(tmp_path: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(tmp_path / "record.db")) as connection:
        connection.executescript(CONTENT)
        write_row_digests(tmp_path / "record.db", tmp_path / "rows.jsonl")
        yield connection


def changes(tmp_path: Path) -> list[str]:
    return [
        f"{difference.where}: {difference.text}"
        for difference in changed_rows(tmp_path / "rows.jsonl", tmp_path / "record.db")
    ]


CHANGED = "changed since it was bundled"


@pytest.mark.parametrize(
    ("statement", "lines"),
    [
        ("UPDATE numbered SET text = text", []),
        ("UPDATE step SET x = x + 1e-15 WHERE number = 1 AND episode = 1", [f"step 1/1: x: {CHANGED}"]),
        ("UPDATE step SET x = 0 WHERE number = 2", [f"step 1/2: x: {CHANGED}"]),
        ("UPDATE step SET action = cast(action AS BLOB) WHERE number = 2", [f"step 1/2: action: {CHANGED}"]),
        ("UPDATE step SET action = 'x', image = NULL WHERE episode = 2", [f"step 2/1: action, image: {CHANGED}"]),
        ("UPDATE step SET number = 9 WHERE number = 2", ["step 1/2: number: is 1/9 since it was bundled"]),
        ("UPDATE step SET action = cast(x'ff' AS TEXT) WHERE episode = 2", [f"step 2/1: action: {CHANGED}"]),
        ("DELETE FROM numbered WHERE id = 2", ["numbered 2: the row was removed"]),
        (
            "INSERT INTO numbered VALUES (8, 'c')",
            ["numbered 8: the row was added", f"sqlite_sequence numbered: seq: {CHANGED}"],
        ),
        ("UPDATE sqlite_sequence SET seq = 9", [f"sqlite_sequence numbered: seq: {CHANGED}"]),
        ("DROP TABLE step", ["step : the table was removed"]),
        ("ALTER TABLE step ADD COLUMN more TEXT", ["step : the table has other columns"]),
        ("CREATE TABLE more (a)", ["more : the table was added"]),
    ],
)
def test_a_change_is_named_by_table_row_and_column(
    database: sqlite3.Connection, tmp_path: Path, statement: str, lines: list[str]
) -> None:
    database.execute(statement)
    database.commit()
    assert changes(tmp_path) == lines


def test_the_same_rows_in_another_file_have_the_same_digests(database: sqlite3.Connection, tmp_path: Path) -> None:
    database.execute("VACUUM INTO ?", [str(tmp_path / "other.db")])
    write_row_digests(tmp_path / "other.db", tmp_path / "other.jsonl")
    assert (tmp_path / "other.jsonl").read_bytes() == (tmp_path / "rows.jsonl").read_bytes()


def test_a_trigger_is_refused(database: sqlite3.Connection, tmp_path: Path) -> None:
    database.execute("CREATE TRIGGER t AFTER INSERT ON step BEGIN DELETE FROM numbered; END")
    with pytest.raises(RecordError, match="trigger"):
        changes(tmp_path)


@pytest.mark.parametrize("line", ["x", "[1]", "[1, 2, 3]", '{"table": 1}', "null", "[" * 5000])
def test_damaged_digests_are_one_line(database: sqlite3.Connection, tmp_path: Path, line: str) -> None:
    with (tmp_path / "rows.jsonl").open("a") as file:
        file.write(f"{line}\n")
    with pytest.raises(RecordError, match="damaged"):
        changes(tmp_path)
