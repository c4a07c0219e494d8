"""Opens the database: SQLite with settings that survive killed processes, or any SQLAlchemy URL."""

import atexit
import json
import logging
import math
import os
import shlex
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import quote

import numpy as np
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.dialects import registry
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, SQLAlchemyError

from vsnbench.config import same_file_above
from vsnbench.errors import RecordError, UsageError
from vsnbench.files.bounded_json import parse_json
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.installation import command_to_add
from vsnbench.results.database_url import parse_url, redacted_url
from vsnbench.results.schema.guard import OBJECTS, refuse_foreign_schema

_opened: dict[str, None] = {}

BUSY_TIMEOUT_S = 1.0
"""Seconds that SQLite waits for another writer; after each period the wait is logged and continues."""
LONGEST_CELL_BYTES = 64 * 2**20
"""Longest text or image that is read; a longer one comes from a record that was made to exhaust the memory."""
_SAY_AGAIN_S = 30.0
_READER_TIMEOUT_S = 30.0
"""Seconds that a reader waits; only for files that are recovered or not in WAL mode."""

logger = logging.getLogger(__name__)


_statements: dict[Any, Any] = {}
"""Compiled statements of all SQLite files of this process: a merge or a verification opens several."""
_MOST_STATEMENTS = 2_000


class SQLiteRecord(SQLiteDialect_pysqlite):
    """SQLite's dialect, equal for all files, so that SQLAlchemy finds what it compiled for another one.

    `open_engine` gives all of them the same options.
    """

    supports_statement_cache = True

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))


_DRIVER = "sqlite+vsnbench"
registry.register(_DRIVER.replace("+", "."), __name__, SQLiteRecord.__name__)


@dataclass
class LockWait:
    """How long a writer of an SQLite file waits for the lock of another process."""

    gives_up: Callable[[], bool] = lambda: False
    """Called after each time-out; True raises a RecordError."""


def database_label(engine: Engine) -> str:
    """Return the database of an engine without its password."""
    return redacted_url(engine.url.render_as_string(hide_password=False))


def open_engine(url: str, *, read_only: bool = False, patience: LockWait | None = None) -> Engine:
    """Return an engine for a database; nothing is created or migrated.

    SQLite uses WAL, foreign keys, a busy time-out, and write transactions that take the lock at their beginning, so
    that concurrent writers queue.

    Args:
        url: SQLAlchemy URL.
        read_only: reject every write; the SQLite file must exist.
        patience: how long a writer waits for another process. Default: forever.

    Raises:
        UsageError: the URL is invalid, or its driver is not installed.
        RecordError: the file to read does not exist.
    """
    parsed = parse_url(url)
    _opened[url] = None
    options: dict[str, Any] = {"json_serializer": to_json, "json_deserializer": parse_json}
    try:
        if parsed.get_backend_name() != "sqlite":
            # Replaces a connection that the server closed in the meantime.
            engine = create_engine(parsed, pool_pre_ping=True, **options)
            return engine.execution_options(postgresql_readonly=True) if read_only else engine
        if read_only and parsed.database:
            options["creator"] = sqlite_reader(Path(parsed.database))
        if parsed.get_driver_name() == SQLiteRecord.driver:
            parsed = parsed.set(drivername=_DRIVER)
            if len(_statements) > _MOST_STATEMENTS:
                _statements.clear()
            options["execution_options"] = {"compiled_cache": _statements}
        engine = create_engine(parsed, connect_args={"timeout": BUSY_TIMEOUT_S}, **options)
    except ArgumentError as error:  # an SQLite URL with a host, or a list of hosts with an invalid port
        raise UsageError(f"{redacted_url(url)} names no database ({str(error).splitlines()[0]})") from error
    except NoSuchModuleError as error:
        raise UsageError(
            f"unknown kind of database in {redacted_url(url)}", advice="use sqlite:/// or postgresql+psycopg://"
        ) from error
    except ImportError as error:
        raise UsageError(
            f"the driver for {redacted_url(url)} is not installed ({error})",
            advice=command_to_add("postgresql"),
        ) from error
    _set_up_sqlite(engine, patience or LockWait(), read_only=read_only)
    return engine


@contextmanager
def opened_engine(url: str, *, read_only: bool = False) -> Iterator[Engine]:
    """Open a database as `open_engine` does, and close it at the end of the block."""
    engine = open_engine(url, read_only=read_only)
    try:
        yield engine
    finally:
        engine.dispose()


def opened_urls() -> tuple[str, ...]:
    """Return the URLs of the databases that this process has opened, in order."""
    return tuple(_opened)


def sqlite_reader(path: Path) -> Callable[[], sqlite3.Connection]:
    """Return a function that opens an SQLite file for reading without changing it.

    Raises:
        RecordError: the file does not exist.
    """
    if not path.is_file():
        advice = "`vsnbench run` creates one, --results selects another directory"
        if (above := same_file_above(path)) is not None:
            advice = f"{above.parent} contains one: use --results {shlex.quote(str(above.parent))}"
        raise RecordError(f"no record at {path.absolute()}", advice=advice)
    # On a read-only disk SQLite cannot create the files that share a WAL, and no process writes. Elsewhere a writable
    # reader would checkpoint the WAL of a killed process when it closes.
    wal = path.with_name(path.name + "-wal")
    if wal.exists() and not path.with_name(path.name + "-shm").exists() and not os.access(path.parent, os.W_OK):
        # A killed process has left a WAL that SQLite cannot read without creating a file.
        path = _copied(path, wal)
        wal = path.with_name(path.name + "-wal")
    mode = "ro" if wal.exists() else "rw" if os.access(path.parent, os.W_OK) else "ro&immutable=1"
    uri = f"file:{quote(str(path.resolve()))}?mode={mode}"
    return lambda: sqlite3.connect(uri, uri=True, timeout=_READER_TIMEOUT_S, check_same_thread=False)


def _copied(path: Path, wal: Path) -> Path:
    """Return a copy of a database and its WAL in a temporary directory of this process."""
    scratch = ScratchDirectory("record")
    atexit.register(scratch.remove)
    try:
        shutil.copyfile(path, scratch.path / path.name)
        shutil.copyfile(wal, scratch.path / wal.name)
    except OSError as error:
        raise RecordError(f"cannot copy {path} to read it: {error.strerror}") from error
    return scratch.path / path.name


def _set_up_sqlite(engine: Engine, patience: LockWait, *, read_only: bool) -> None:
    @event.listens_for(engine, "connect")
    def connect(connection: sqlite3.Connection, _record: object) -> None:
        connection.isolation_level = None  # transactions are started by `begin` below
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA trusted_schema = OFF")  # untrusted schemas cannot call functions with side effects
        connection.execute("PRAGMA cell_size_check = ON")
        if read_only:
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_CELL_BYTES)
            refuse_foreign_schema(connection, database_label(engine))
            connection.execute("PRAGMA query_only = ON")
            return
        _patiently(connection, OBJECTS, engine, patience)
        refuse_foreign_schema(connection, database_label(engine))
        _patiently(connection, "PRAGMA journal_mode = WAL", engine, patience)
        # In WAL mode NORMAL survives kill -9; a power failure can lose the last commits but not corrupt the file.
        connection.execute("PRAGMA synchronous = NORMAL")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        raw = connection.connection.dbapi_connection
        if read_only or connection.get_execution_options().get(_READS) or not isinstance(raw, sqlite3.Connection):
            connection.exec_driver_sql("BEGIN")
        else:
            try:
                _patiently(raw, "BEGIN IMMEDIATE", engine, patience)
            except sqlite3.OperationalError:  # raised again where SQLAlchemy converts it
                connection.exec_driver_sql("BEGIN IMMEDIATE")


def _patiently(connection: sqlite3.Connection, statement: str, engine: Engine, patience: LockWait) -> None:
    """Execute a statement that needs the lock, and retry while another process holds it.

    A failed attempt has written nothing, so that it can be retried. Each attempt ends within `BUSY_TIMEOUT_S`, so that
    signals are handled.
    """
    began_s = said_s = time.monotonic()
    while True:
        try:
            connection.execute(statement)
        except sqlite3.OperationalError as error:
            if getattr(error, "sqlite_errorcode", 0) & 0xFF not in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise
            if patience.gives_up():
                raise
            now_s = time.monotonic()
            if said_s == began_s or now_s - said_s >= _SAY_AGAIN_S:
                logger.warning(
                    "waiting for another process that is writing to %s, for %.0f s so far; Ctrl-C cancels",
                    database_label(engine),
                    now_s - began_s,
                )
                said_s = now_s
        else:
            if said_s != began_s:
                logger.warning("the wait for %s has ended", database_label(engine))
            return


_READS = "vsnbench_reads"


def reading(engine: Engine) -> Engine:
    """Return the engine for read-only transactions, which do not block writers."""
    return engine.execution_options(**{_READS: True})


@contextmanager
def record_errors(engine: Engine) -> Iterator[None]:
    """Convert errors of the database driver to RecordError.

    Raises:
        RecordError: the database could not be used.
    """
    try:
        yield
    except SQLAlchemyError as error:
        _raise_record_error(error, engine)
    except OverflowError as error:  # the number does not fit into any column
        raise RecordError(
            f"a number is too large for the database {database_label(engine)}", advice="use at most 18 digits"
        ) from error
    except UnicodeDecodeError as error:  # a name in the schema, or an error message of SQLite
        raise RecordError(
            f"cannot use the database {database_label(engine)}: text in it is not UTF-8", advice=_DAMAGED
        ) from error


@contextmanager
def transaction(engine: Engine) -> Iterator[Connection]:
    """Commit the block as one transaction.

    Raises:
        RecordError: the database could not be used.
    """
    with record_errors(engine), engine.begin() as connection:
        yield connection


def _raise_record_error(error: SQLAlchemyError, engine: Engine) -> NoReturn:
    """Raise errors with a known remedy as RecordError, and programming errors unchanged."""
    if not isinstance(error, DBAPIError):
        raise error
    cause = str(error.orig).strip().splitlines()[0] if error.orig and str(error.orig).strip() else str(error)
    where = database_label(engine)
    for words, advice in _ADVICE.items():
        if words in cause.lower():
            raise RecordError(f"cannot use the database {where}: {cause}", advice=advice) from error
    if error.connection_invalidated or type(error.orig).__name__ in _UNUSABLE:
        raise RecordError(f"cannot use the database {where}: {cause}") from error
    raise error


_UNUSABLE = ("OperationalError", "DatabaseError", "DataError")
_DAMAGED = "the file is damaged; `vsnbench db restore` replaces it by a backup"
_ADVICE = {
    "disk is full": "the disk is full: free some space and repeat the command",
    "no space left": "the disk is full: free some space and repeat the command",
    "disk i/o error": "the disk cannot be written: check its free space and health, then repeat the command",
    "readonly": "it is read-only: check the directory's permissions, or choose another with --results",
    "read-only": "it is read-only: choose another results directory with --results",
    "unable to open": "check the path and its permissions, or choose another directory with --results",
    "locked": "another process has locked it: wait for that process, or stop it",
    "not a database": "the file is not a database: choose another results directory with --results",
    "malformed": _DAMAGED,
    "could not decode": _DAMAGED,
    "no such table": "it contains no record: `vsnbench db upgrade` creates one",
    "connection refused": "the server does not answer: is it running, and is the address right?",
    "password authentication": "the server refused the user or the password in the URL",
}


def to_json(value: object, *, in_order: bool = False) -> str:
    """Return JSON that every database accepts: arrays become lists, non-finite numbers become null.

    Args:
        value: any value; unsupported types are converted to text.
        in_order: sort the keys, so that equal values give equal text.
    """
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"), sort_keys=in_order)


def _plain(value: object) -> object:
    if isinstance(value, float):  # the most frequent type in a step's details
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    match value:
        case None | bool() | int():
            return value
        case str():
            return value.replace("\x00", "\N{REPLACEMENT CHARACTER}")  # PostgreSQL does not accept NUL in text
        case Mapping():
            return {str(key): _plain(item) for key, item in value.items()}
        case np.ndarray() | np.generic():
            return _plain(value.tolist())
        case set() | frozenset():
            return sorted((_plain(item) for item in value), key=str)
        case _:
            return str(value)
