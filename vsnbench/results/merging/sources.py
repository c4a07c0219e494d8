"""Opens another record for a merge: a read-only snapshot with the current schema.

An SQLite file is copied first: older schemas are upgraded on the copy, and untrusted content is validated. A server
database is read within one transaction.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Engine

from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.merging.plan import OtherRecord
from vsnbench.results.reading.integrity import record_fault
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import open_engine, record_errors
from vsnbench.results.schema.migrate import schema_state, upgrade


@contextmanager
def open_other(url: str, name: str, scratch: Path) -> Iterator[OtherRecord]:
    """Open an untrusted record.

    Raises:
        RecordError: no record exists, its schema is newer (or older, on a server), or its content is invalid.
        UsageError: the URL is invalid.
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
        raise RecordError(f"{name} contains no record; nothing was written")
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
            raise RecordError(f"{name} contains no record; nothing was written")
        upgrade(engine, is_copy=True)
    except RecordError as error:
        engine.dispose()
        raise RecordError(error.statement.replace(str(file), name), advice=error.advice) from error
    _look_through(copy, name)
    return engine


def _look_through(url: str, name: str) -> None:
    if fault := record_fault(url):
        raise RecordError(f"the record {name} has invalid content: {fault}; nothing was written")
