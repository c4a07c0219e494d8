"""Opens the database of the record: SQLite set up so that a killed process loses nothing, or any SQLAlchemy URL."""

import json
import logging
import math
import os
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
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, SQLAlchemyError

from vsnbench.database_url import parse_url, shown_url
from vsnbench.errors import RecordError, UsageError

_opened: dict[str, None] = {}

BUSY_TIMEOUT_S = 1.0
"""How long SQLite itself waits for another writer; after each such time it is said who waits, and waiting goes on."""
_SAY_AGAIN_S = 30.0
_READER_TIMEOUT_S = 30.0
"""A reader waits only for a file that is not in WAL mode, or is being recovered."""

logger = logging.getLogger(__name__)


@dataclass
class LockPatience:
    """How long a writer of an SQLite file waits while another process has locked it: until it gives up."""

    gives_up: Callable[[], bool] = lambda: False
    """Asked after each time-out; True makes it a RecordError."""


def shown_database(engine: Engine) -> str:
    """Return an engine's database as it may be printed."""
    return shown_url(engine.url.render_as_string(hide_password=False))


def open_engine(url: str, *, read_only: bool = False, patience: LockPatience | None = None) -> Engine:
    """Return an engine on the database; nothing is created or migrated.

    SQLite: WAL, foreign keys on, a busy time-out, and a write transaction that takes the lock when it begins, so that
    two writers queue up instead of failing half-way.

    Args:
        url: any SQLAlchemy URL.
        read_only: refuse every write; the SQLite file must exist.
        patience: how long a writer waits for another process; for ever when not given.

    Raises:
        UsageError: the URL is not one, or its driver is not installed.
        RecordError: there is no file to read.
    """
    parsed = parse_url(url)
    _opened[url] = None
    options: dict[str, Any] = {"json_serializer": to_json}
    try:
        if parsed.get_backend_name() != "sqlite":
            # A connection that the server closed overnight is replaced instead of failing the next step.
            engine = create_engine(parsed, pool_pre_ping=True, **options)
            return engine.execution_options(postgresql_readonly=True) if read_only else engine
        if read_only and parsed.database:
            options["creator"] = sqlite_reader(Path(parsed.database))
        engine = create_engine(parsed, connect_args={"timeout": BUSY_TIMEOUT_S}, **options)
    except ArgumentError as error:  # an SQLite URL with a host, a list of hosts with a port that is none
        raise UsageError(f"{shown_url(url)} names no database ({str(error).splitlines()[0]})") from error
    except NoSuchModuleError as error:
        raise UsageError(
            f"no such kind of database in {shown_url(url)}", advice="use sqlite:/// or postgresql+psycopg://"
        ) from error
    except ImportError as error:
        raise UsageError(
            f"the driver for {shown_url(url)} is not installed ({error})", advice="pip install 'vsnbench[postgresql]'"
        ) from error
    _set_up_sqlite(engine, patience or LockPatience(), read_only=read_only)
    return engine


def opened_urls() -> tuple[str, ...]:
    """Return the databases that this process has opened, in that order."""
    return tuple(_opened)


def sqlite_reader(path: Path) -> Callable[[], sqlite3.Connection]:
    """Return what opens an SQLite file for reading, and leaves it as it is.

    Raises:
        RecordError: there is no such file.
    """
    if not path.is_file():
        raise RecordError(
            f"there is no record at {path}", advice="`vsnbench run` makes one, --results says where to look"
        )
    # An archive on a read-only disk has no place for the files that share a WAL; nobody can be writing it either. A
    # reader that could write would fold a WAL that a killed process left into the file when it closes.
    wal = path.with_name(path.name + "-wal")
    mode = "ro" if wal.exists() else "rw" if os.access(path.parent, os.W_OK) else "ro&immutable=1"
    uri = f"file:{quote(str(path.resolve()))}?mode={mode}"
    return lambda: sqlite3.connect(uri, uri=True, timeout=_READER_TIMEOUT_S, check_same_thread=False)


def _set_up_sqlite(engine: Engine, patience: LockPatience, *, read_only: bool) -> None:
    @event.listens_for(engine, "connect")
    def connect(connection: sqlite3.Connection, _record: object) -> None:
        connection.isolation_level = None  # the driver begins no transaction of its own: `begin` below does
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA trusted_schema = OFF")  # a stranger's schema calls no function with side effects
        if read_only:
            connection.execute("PRAGMA query_only = ON")
            return
        _patiently(connection, "PRAGMA journal_mode = WAL", engine, patience)
        # In WAL, NORMAL survives kill -9 whole; only a power cut can lose the last commits, never corrupt the file.
        connection.execute("PRAGMA synchronous = NORMAL")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        raw = connection.connection.dbapi_connection
        if read_only or connection.get_execution_options().get(_READS) or not isinstance(raw, sqlite3.Connection):
            connection.exec_driver_sql("BEGIN")
        else:
            try:
                _patiently(raw, "BEGIN IMMEDIATE", engine, patience)
            except sqlite3.OperationalError:  # raised again where SQLAlchemy makes an error of its own of it
                connection.exec_driver_sql("BEGIN IMMEDIATE")


def _patiently(connection: sqlite3.Connection, statement: str, engine: Engine, patience: LockPatience) -> None:
    """Carry out a statement that needs the file to itself, as long as it takes: what drove until here is at rest.

    Nothing has been written when it fails for want of the lock, so it may be tried again; each try ends within
    `BUSY_TIMEOUT_S`, so that a signal is heard.
    """
    began_s = said_s = time.monotonic()
    while True:
        try:
            connection.execute(statement)
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise
            if patience.gives_up():
                raise
            now_s = time.monotonic()
            if said_s == began_s or now_s - said_s >= _SAY_AGAIN_S:
                logger.warning(
                    "waiting for another process that is writing %s, for %.0f s now; Ctrl-C gives up",
                    shown_database(engine),
                    now_s - began_s,
                )
                said_s = now_s
        else:
            if said_s != began_s:
                logger.warning("the wait for %s is over", shown_database(engine))
            return


_READS = "vsnbench_reads"


def reading(engine: Engine) -> Engine:
    """Return the same engine for transactions that only read: they wait for no writer and none waits for them."""
    return engine.execution_options(**{_READS: True})


@contextmanager
def record_errors(engine: Engine) -> Iterator[None]:
    """Turn what the database driver raises into one line for the user.

    Raises:
        RecordError: the database could not be used.
    """
    try:
        yield
    except SQLAlchemyError as error:
        _raise_record_error(error, engine)


@contextmanager
def transaction(engine: Engine) -> Iterator[Connection]:
    """Commit what happens inside, all of it or nothing.

    Raises:
        RecordError: the database could not be used.
    """
    with record_errors(engine), engine.begin() as connection:
        yield connection


def _raise_record_error(error: SQLAlchemyError, engine: Engine) -> NoReturn:
    """Raise what a user can do something about as RecordError, and our own mistakes as they are."""
    if not isinstance(error, DBAPIError):
        raise error
    cause = str(error.orig).strip().splitlines()[0] if error.orig and str(error.orig).strip() else str(error)
    where = shown_database(engine)
    for words, advice in _ADVICE.items():
        if words in cause.lower():
            raise RecordError(f"cannot use the database {where}: {cause}", advice=advice) from error
    if error.connection_invalidated or type(error.orig).__name__ in ("OperationalError", "DatabaseError"):
        raise RecordError(f"cannot use the database {where}: {cause}") from error
    raise error


_ADVICE = {
    "disk is full": "the disk is full: free some space and run the same command again",
    "no space left": "the disk is full: free some space and run the same command again",
    "disk i/o error": "the disk cannot be written: look at its free space and health, then run the same command again",
    "readonly": "it cannot be written: look at the directory's permissions, or choose another with --results",
    "read-only": "it cannot be written: choose another results directory with --results",
    "unable to open": "look at the path and its permissions, or choose another directory with --results",
    "locked": "another process has it to itself: wait for it, or stop it",
    "not a database": "the file is something else: choose another results directory with --results",
    "malformed": "the file is damaged: restore a backup (`vsnbench db backup` makes them)",
    "no such table": "it has no record in it: `vsnbench db upgrade` makes one",
    "connection refused": "the server does not answer: is it running, and is the address right?",
    "password authentication": "the server refused the user or the password in the URL",
}


def to_json(value: object, *, in_order: bool = False) -> str:
    """Return JSON that every database takes: arrays become lists, numbers that are not finite become null.

    Args:
        value: anything; what JSON does not know becomes its text.
        in_order: sort the keys, so that equal values give equal text.
    """
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"), sort_keys=in_order)


def _plain(value: object) -> object:
    kind = type(value)
    if kind is float:  # most of a step's details are: no further question is asked of them
        return value if math.isfinite(value) else None  # type: ignore[arg-type]
    if kind is list or kind is tuple:
        return [_plain(item) for item in value]  # type: ignore[attr-defined]
    match value:
        case None | bool() | int():
            return value
        case str():
            return value.replace("\x00", "\N{REPLACEMENT CHARACTER}")  # PostgreSQL takes no NUL in text
        case float():
            return value if math.isfinite(value) else None
        case Mapping():
            return {str(key): _plain(item) for key, item in value.items()}
        case np.ndarray() | np.generic():
            return _plain(value.tolist())
        case list() | tuple():
            return [_plain(item) for item in value]
        case set() | frozenset():
            return sorted((_plain(item) for item in value), key=str)
        case _:
            return str(value)
