"""Rejects SQLite files whose schema can run code: views, triggers, virtual tables, computed columns and indexes."""

import sqlite3

from vsnbench.errors import RecordError
from vsnbench.text.sanitize import sanitize

OBJECTS = "SELECT type, name, rootpage, sql FROM sqlite_master"
_COMPUTED_COLUMNS = (
    "SELECT t.name || '.' || c.name FROM sqlite_master t, pragma_table_xinfo(t.name) c "
    "WHERE t.type = 'table' AND c.hidden <> 0 LIMIT 1"
)
_COMPUTED_INDEXES = (
    "SELECT i.name FROM sqlite_master i, pragma_index_xinfo(i.name) c WHERE i.type = 'index' AND c.cid = -2 LIMIT 1"
)
_STORED = {"table": ("CREATE TABLE ",), "index": ("CREATE INDEX ", "CREATE UNIQUE INDEX ")}
"""Kinds of objects stored in the file, with the beginnings of their definitions."""


def refuse_foreign_schema(connection: sqlite3.Connection, where: str) -> None:
    """Accept only tables and indexes that are stored in the file.

    A view instead of a table can run without end, and a trigger can change other rows. The check only reads
    definitions.

    Raises:
        RecordError: the schema contains something else.
        sqlite3.Error: the schema cannot be read.
    """
    for kind, name, root_page, definition in connection.execute(OBJECTS).fetchall():
        if not _is_stored(kind, root_page, definition):
            _refuse(str(kind) if kind in ("view", "trigger") else "virtual table", name, where)
    for query, what in ((_COMPUTED_COLUMNS, "computed column"), (_COMPUTED_INDEXES, "index on an expression")):
        found = connection.execute(query).fetchone()
        if found is not None:
            _refuse(what, found[0], where)


def _is_stored(kind: object, root_page: object, definition: object) -> bool:
    begins = _STORED.get(str(kind))
    if begins is None or not isinstance(root_page, int) or root_page < 1:
        return False
    if definition is None:
        return kind == "index"  # SQLite creates indexes for primary keys without a definition
    return isinstance(definition, str) and definition.startswith(begins)


def _refuse(what: str, name: object, where: str) -> None:
    raise RecordError(
        f"the database {where} has a {what} {sanitize(str(name))[:60]!r}, which vsnbench never creates",
        advice="do not use it; `vsnbench db restore` replaces it by a backup",
    )
