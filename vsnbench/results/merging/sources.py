"""Opens another record for a merge: a read-only snapshot with the current schema.

An SQLite file is copied first: older schemas are upgraded on the copy, and untrusted content is validated. A server
database is read within one transaction.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.merging.episodes import OtherRecord
from vsnbench.results.reading.integrity import record_fault
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import opened_engine, record_errors
from vsnbench.results.schema.migrate import schema_state, upgrade


@contextmanager
def open_other(url: str, name: str, scratch: Path) -> Iterator[OtherRecord]:
    """Open an untrusted record.

    Raises:
        RecordError: no record exists, its schema is newer (or older, on a server), or its content is invalid.
        UsageError: the URL is invalid.
    """
    if sqlite_path(url) is None:
        _check_server(url, name)
    else:
        file = scratch / "other.db"
        copy_record(url, name, file)
        url = sqlite_url(file)
    if fault := record_fault(url):
        raise RecordError(f"the record {name} has invalid content: {fault}; nothing was written")
    with opened_engine(url, read_only=True) as engine, record_errors(engine), engine.connect() as connection:
        if connection.dialect.name == "postgresql":
            connection.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
        with connection.begin():
            yield OtherRecord(name, connection)


def _check_server(url: str, name: str) -> None:
    with opened_engine(url, read_only=True) as engine:
        state = schema_state(engine)
    if state.current is None:
        raise _no_record(name)
    if not state.up_to_date:
        raise RecordError(
            f"{name} has the older schema {state.current}, this version reads {state.head}, and a server's database is "
            "not copied",
            advice="nothing was written; `vsnbench db upgrade --db URL` brings it up to date",
        )


def copy_record(url: str, name: str, file: Path) -> None:
    """Copy an untrusted SQLite record to a new file, and upgrade the copy.

    Raises:
        RecordError: no record exists, it is damaged, it has views or triggers, or its schema is newer.
    """
    backup(url, file)
    try:
        with opened_engine(sqlite_url(file)) as engine:
            if schema_state(engine).current is None:
                raise _no_record(name)
            upgrade(engine, is_copy=True)
    except RecordError as error:
        raise RecordError(error.statement.replace(str(file), name), advice=error.advice) from error


def _no_record(name: str) -> RecordError:
    return RecordError(f"{name} contains no record; nothing was written")
