"""Replaces a database by a verified backup, and keeps the present database.

A restore also works if the present database is damaged.
"""

import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.results.database_url import libpq_connection, sqlite_path, sqlite_url
from vsnbench.results.schema.backup import backup, run_postgresql_client
from vsnbench.results.schema.engine import database_label, opened_engine, record_errors, sqlite_reader
from vsnbench.results.schema.guard import refuse_foreign_schema
from vsnbench.results.schema.migrate import schema_state
from vsnbench.results.writing.provenance import this_process
from vsnbench.results.writing.recovery import live_writers


def restore(url: str, source: Path, directory: Path) -> Path | None:
    """Replace a database by a backup: all or nothing.

    Args:
        url: the database; an SQLite file may be missing.
        source: a backup of the same kind of database, written by `backup`.
        directory: directory in which the present database is kept.

    Returns:
        The backup of the present database, or its copy if it is damaged; None if there was none.

    Raises:
        RecordError: the backup is invalid, a process writes to the database, or one of them cannot be used.
    """
    if not source.is_file():
        raise RecordError(f"backup {source} does not exist", advice="name a file that `vsnbench db backup` wrote")
    target = sqlite_path(url)
    if target is None:
        _check_archive(source)
        kept = _keep(url, directory)
        _restore_postgresql(url, source)
        return kept
    _check_sqlite(source)
    if not target.exists():
        kept = None
    elif target.resolve() == source.resolve():
        raise RecordError(f"{source} is the database itself", advice="name a backup of it")
    else:
        kept = _keep(url, directory) if _is_usable(target) else _set_aside(target, directory)
    _restore_sqlite(target, source)
    return kept


def _check_sqlite(source: Path) -> None:
    advice = "nothing was changed; name a file that `vsnbench db backup` wrote"
    try:
        with closing(sqlite_reader(source)()) as database:
            (verdict,) = database.execute("PRAGMA quick_check").fetchone()
    except sqlite3.DatabaseError as error:
        raise RecordError(f"{source} is not a backup of an SQLite database: {error}", advice=advice) from error
    if verdict != "ok":
        raise RecordError(f"the backup {source} is damaged: {verdict}", advice=advice)
    with opened_engine(sqlite_url(source), read_only=True) as engine:
        if schema_state(engine).current is None:
            raise RecordError(f"the backup {source} is empty", advice=advice)


def _check_archive(source: Path) -> None:
    listed = run_postgresql_client(["pg_restore", "--list", str(source)], {})
    if "alembic_version" not in listed or " episode " not in listed:
        raise RecordError(
            f"{source} is not a backup of a vsnbench database on PostgreSQL",
            advice="nothing was changed; name a file that `vsnbench db backup` wrote",
        )


def _keep(url: str, directory: Path) -> Path | None:
    """Back up the present database, unless it is empty."""
    with opened_engine(url) as engine:
        if schema_state(engine).current is None:
            return None
        with record_errors(engine), engine.connect() as connection:
            who = live_writers(connection, this_process())
        if who:
            raise RecordError(
                f"{who} writes to the database {database_label(engine)}; nothing was changed",
                advice="repeat the command when it has ended",
            )
    kept = _new_name(directory)
    backup(url, kept)
    return kept


def _new_name(directory: Path) -> Path:
    now = datetime.now(UTC)
    return directory / f"before-restore-{now:%Y-%m-%dT%H%M%S}-{now.microsecond:06d}.backup"


def _is_usable(target: Path) -> bool:
    """Return whether the file is a usable database."""
    try:
        with closing(sqlite_reader(target)()) as database:
            refuse_foreign_schema(database, str(target))
            return bool(database.execute("PRAGMA quick_check").fetchone() == ("ok",))
    except sqlite3.OperationalError as error:
        raise RecordError(f"cannot read the database {target}: {error}", advice="nothing was changed") from error
    except (sqlite3.DatabaseError, UnicodeDecodeError, RecordError):
        return False


def _set_aside(target: Path, directory: Path) -> Path:
    """Move an unusable database and its companion files out of the way."""
    kept = _new_name(directory)
    try:
        for suffix in ("-wal", "-shm", "-journal", ""):
            part = target.with_name(target.name + suffix)
            if part.exists():
                part.rename(kept.with_name(kept.name + suffix))
    except OSError as error:
        raise RecordError(f"cannot move {target} to {kept}: {error.strerror}", advice="nothing was restored") from error
    return kept


def _restore_sqlite(target: Path, source: Path) -> None:
    """Copy a backup into the database's own file, in one transaction."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        with closing(sqlite_reader(source)()) as copy, closing(sqlite3.connect(target, timeout=30)) as database:
            copy.backup(database)
    except sqlite3.Error as error:
        raise RecordError(f"cannot restore {target}: {error}", advice="nothing was changed") from error


def _restore_postgresql(url: str, source: Path) -> None:
    connection, secrets = libpq_connection(url)
    options = ["--no-password", "--clean", "--if-exists", "--no-owner", "--single-transaction", "--exit-on-error"]
    run_postgresql_client(["pg_restore", *options, f"--dbname={connection}", str(source)], secrets)
