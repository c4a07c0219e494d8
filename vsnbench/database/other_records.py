"""Opens another record to be merged: one snapshot of it, of this version's schema, and nothing of it is touched.

An SQLite file is copied first, so that an older schema is upgraded on the copy, and what a stranger wrote is looked
through before a row of it is believed. A server's database is read within one transaction.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Engine

from vsnbench.database.engine import open_engine, record_errors
from vsnbench.database.merge_plan import OtherRecord
from vsnbench.database.migrate import backup, schema_state, upgrade
from vsnbench.database.soundness import record_fault
from vsnbench.database_url import sqlite_path, sqlite_url
from vsnbench.errors import RecordError


@contextmanager
def open_other(url: str, name: str, scratch: Path) -> Iterator[OtherRecord]:
    """Open a record that somebody else may have made.

    Args:
        url: its database.
        name: what it is called in messages.
        scratch: an empty directory of this record's own, for the copy.

    Raises:
        RecordError: there is no record, it is a newer vsnbench's, an older one's on a server, or not sound.
        UsageError: the URL is not one.
    """
    engine = _server(url, name) if sqlite_path(url) is None else _copy(url, name, scratch)
    try:
        with record_errors(engine), engine.connect() as connection:
            if connection.dialect.name == "postgresql":
                connection.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
            with connection.begin():
                yield OtherRecord(name, connection)
    finally:
        engine.dispose()


def _server(url: str, name: str) -> Engine:
    engine = open_engine(url, read_only=True)
    state = schema_state(engine)
    if state.current is None:
        raise RecordError(f"there is no record in {name}; nothing was written")
    if not state.up_to_date:
        raise RecordError(
            f"{name} has the older schema {state.current}, this version reads {state.head}, and a server's database is "
            "not copied",
            advice="nothing was written; `vsnbench db upgrade --db URL` brings it up to date",
        )
    _look_through(url, name)
    return engine


def _copy(url: str, name: str, scratch: Path) -> Engine:
    file = scratch / "other.db"
    backup(url, file)
    copy = sqlite_url(file)
    engine = open_engine(copy)
    try:
        if schema_state(engine).current is None:
            raise RecordError(f"there is no record in {name}; nothing was written")
        upgrade(engine, is_copy=True)
    except RecordError as error:
        engine.dispose()
        raise RecordError(error.statement.replace(str(file), name), advice=error.advice) from error
    _look_through(copy, name)
    return engine


def _look_through(url: str, name: str) -> None:
    if fault := record_fault(url):
        raise RecordError(f"the record {name} holds what no vsnbench writes: {fault}; nothing was written")
