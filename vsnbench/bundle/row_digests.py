"""Digests of every row of a bundle's database, which name the row and the column of a change.

The manifest's hash of the database finds every change. The digests say where it is. They are lines of JSON: for each
table a line with its columns and its key, then a line per row with the key, the SHA-256 of the row, and four bytes of
the SHA-256 of each cell, which only locate the column.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError
from vsnbench.files.bounded_json import parse_json
from vsnbench.results.schema.engine import LONGEST_CELL_BYTES, sqlite_reader
from vsnbench.results.schema.guard import refuse_foreign_schema

ROW_DIGESTS = "digests/rows.jsonl"
"""File of the digests in a bundle."""
_CELL_DIGITS = 8
_LONGEST_LINE = 1_000_000


@dataclass(frozen=True, slots=True)
class RowDifference:
    """A row that differs from its digest."""

    table: str
    key: tuple[Any, ...]
    columns: tuple[str, ...]
    """Changed columns; empty for a row that was added or removed."""
    text: str

    @property
    def where(self) -> str:
        """Table, key of the row, and columns."""
        key = "/".join(map(str, self.key))
        return f"{self.table} {key}: {', '.join(self.columns)}" if self.columns else f"{self.table} {key}"


@dataclass(frozen=True, slots=True)
class _Table:
    name: str
    columns: tuple[str, ...]
    key: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Row:
    sha256: str
    cells: str


def row_digests(database: Path) -> Iterator[str]:
    """Yield the lines of ROW_DIGESTS for an SQLite file.

    Raises:
        RecordError: the database cannot be read, or has views or triggers.
    """
    with _reading(database) as connection:
        for table in _tables(connection):
            yield json.dumps({"table": table.name, "columns": table.columns, "key": table.key}) + "\n"
            for key, row in _rows(connection, table):
                yield json.dumps([key, row.sha256, row.cells]) + "\n"


def write_row_digests(database: Path, path: Path) -> None:
    """Write the digests of an SQLite file.

    Raises:
        RecordError: the database cannot be read, or the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding="ascii") as file:
            file.writelines(row_digests(database))
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror or error}", advice="free some space") from error


def changed_rows(digests: Path, database: Path) -> Iterator[RowDifference]:
    """Yield the rows of a database that differ from their digests.

    Raises:
        RecordError: the digests or the database cannot be read, or the database has views or triggers.
    """
    with _reading(database) as connection, digests.open(encoding="utf-8") as file:
        present = {table.name: table for table in _tables(connection)}
        recorded: dict[str, _Row] = {}
        table: _Table | None = None
        for line in iter(lambda: file.readline(_LONGEST_LINE), ""):
            content = _parsed(line)
            if isinstance(content, dict):
                if table is not None:
                    yield from _differences(connection, table, present.pop(table.name, None), recorded)
                table, recorded = _table_of(content), {}
            else:
                key, sha256, cells = content
                recorded[json.dumps(key)] = _Row(str(sha256), str(cells))
        if table is not None:
            yield from _differences(connection, table, present.pop(table.name, None), recorded)
        for name in present:
            yield RowDifference(name, (), (), "the table was added")


def _parsed(line: str) -> Any:
    try:
        content = parse_json(line)
        if isinstance(content, dict):
            _table_of(content)
            return content
        key, _, _ = content
        return content if isinstance(key, list) else _parsed("")
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise RecordError(f"{ROW_DIGESTS} is damaged: it has an invalid line") from error


def _table_of(content: Mapping[str, Any]) -> _Table:
    return _Table(str(content["table"]), tuple(map(str, content["columns"])), tuple(map(str, content["key"])))


def _differences(
    connection: sqlite3.Connection, recorded: _Table, present: _Table | None, rows: dict[str, _Row]
) -> Iterator[RowDifference]:
    if present is None:
        yield RowDifference(recorded.name, (), (), "the table was removed")
        return
    if present != recorded:
        yield RowDifference(recorded.name, (), (), "the table has other columns")
        return
    added: dict[str, _Row] = {}
    for key, row in _rows(connection, present):
        before = rows.pop(json.dumps(key), None)
        if before is None:
            added[json.dumps(key)] = row
        elif before.sha256 != row.sha256:
            yield RowDifference(
                present.name, tuple(key), _changed(present, before, row), "changed since it was bundled"
            )
    for removed, before in rows.items():
        # A row whose key was changed has the other cells of the row that is missing.
        renamed = next(
            (key for key, row in added.items() if set(_changed(present, before, row)) <= set(present.key)), ""
        )
        if renamed:
            row = added.pop(renamed)
            text = f"is {'/'.join(map(str, json.loads(renamed)))} since it was bundled"
            yield RowDifference(present.name, tuple(json.loads(removed)), _changed(present, before, row), text)
        else:
            yield RowDifference(present.name, tuple(json.loads(removed)), (), "the row was removed")
    for left in added:
        yield RowDifference(present.name, tuple(json.loads(left)), (), "the row was added")


def _changed(table: _Table, before: _Row, now: _Row) -> tuple[str, ...]:
    """Return the columns whose cells differ."""
    return tuple(
        column for place, column in enumerate(table.columns) if _cell(before.cells, place) != _cell(now.cells, place)
    )


def _cell(cells: str, place: int) -> str:
    return cells[place * _CELL_DIGITS : (place + 1) * _CELL_DIGITS]


def _reading(database: Path) -> "closing[sqlite3.Connection]":
    try:
        connection = sqlite_reader(database)()
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_CELL_BYTES)
        refuse_foreign_schema(connection, str(database))
        connection.execute("PRAGMA query_only = ON")
        connection.text_factory = lambda content: content.decode("utf-8", "surrogateescape")  # of damaged text too
    except sqlite3.Error as error:
        raise _unreadable(database, error) from error
    return closing(connection)


def _tables(connection: sqlite3.Connection) -> list[_Table]:
    try:
        names = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name").fetchall()
        found = []
        for (name,) in names:
            columns = connection.execute("SELECT name, pk FROM pragma_table_info(?) ORDER BY cid", [name]).fetchall()
            key = [column for column, place in sorted(columns, key=lambda column: column[1]) if place]
            # Tables without a key, such as SQLite's own of the last numbers, have their first column as the key.
            found.append(_Table(name, tuple(column for column, _ in columns), tuple(key or [columns[0][0]])))
    except (sqlite3.Error, IndexError) as error:
        raise _unreadable(Path("the bundle's database"), error) from error
    return found


def _rows(connection: sqlite3.Connection, table: _Table) -> Iterator[tuple[list[Any], _Row]]:
    """Yield the key and the digests of every row, in the order of the keys."""
    columns, order = (", ".join(map(_quoted, names)) for names in (table.columns, table.key))
    query = f"SELECT {columns} FROM {_quoted(table.name)} ORDER BY {order}"  # noqa: S608 - quoted names
    places = [table.columns.index(name) for name in table.key]
    try:
        for row in connection.execute(query):
            hashes = [hashlib.sha256(_encoded(value)).digest() for value in row]
            key = [_shown(row[place]) for place in places]
            cells = "".join(digest[: _CELL_DIGITS // 2].hex() for digest in hashes)
            yield key, _Row(hashlib.sha256(b"".join(hashes)).hexdigest(), cells)
    except sqlite3.Error as error:
        raise _unreadable(Path(f"table {table.name}"), error) from error


def _encoded(value: object) -> bytes:
    """Return the bytes of a cell with its type."""
    if isinstance(value, bytes):
        return b"b" + value
    return b"t" + value.encode("utf-8", "surrogateescape") if isinstance(value, str) else repr(value).encode()


def _shown(value: Any) -> Any:
    """Return a value of a key that JSON can represent."""
    return repr(value) if isinstance(value, bytes) else value


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _unreadable(what: Path, error: Exception) -> RecordError:
    return RecordError(f"cannot read {what}: {error}", advice="the file is damaged: get another copy")
