"""Backups of a database, as one file."""

import os
import sqlite3
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.files.atomic import atomic_file
from vsnbench.results.database_url import libpq_connection, sqlite_path
from vsnbench.results.schema.engine import sqlite_reader
from vsnbench.results.schema.guard import refuse_foreign_schema


def backup(url: str, target: Path) -> None:
    """Copy the database to a new file atomically while others may be writing.

    SQLite is copied as a file, PostgreSQL with `pg_dump` in its custom format.

    Raises:
        RecordError: the copy cannot be made.
    """
    if target.exists():
        raise RecordError(f"{target} already exists", advice="choose a new file for the backup")
    if not target.parent.is_dir():
        raise RecordError(f"the directory {target.parent} does not exist", advice="create it, or choose another place")
    source = sqlite_path(url)
    try:
        with atomic_file(target) as part:
            if source is None:
                _dump_postgresql(url, part)
            else:
                _copy_sqlite(source, part)
    except sqlite3.Error as error:
        raise RecordError(f"cannot write the backup {target}: {error}") from error


def _copy_sqlite(source: Path, target: Path) -> None:
    if not source.is_file():
        raise RecordError(f"no record at {source}: nothing to back up")
    with closing(sqlite_reader(source)()) as database, closing(sqlite3.connect(target)) as copy:
        refuse_foreign_schema(database, str(source))
        database.backup(copy)
        # A single file: a copy in WAL mode would need its companion files.
        copy.execute("PRAGMA journal_mode = DELETE")
        (verdict,) = copy.execute("PRAGMA quick_check").fetchone()
    if verdict != "ok":
        raise RecordError(
            f"the database {source} is damaged ({verdict}) and was not copied", advice="restore an earlier backup"
        )


def _dump_postgresql(url: str, target: Path) -> None:
    connection, secrets = libpq_connection(url)
    run_postgresql_client(
        ["pg_dump", "--no-password", "--format=custom", f"--file={target}", f"--dbname={connection}"], secrets
    )


def run_postgresql_client(command: Sequence[str], secrets: Mapping[str, str]) -> str:
    """Run a program of PostgreSQL's client with further environment variables, and return its output.

    Raises:
        RecordError: the program is not installed, or failed.
    """
    program, environment = command[0], {**os.environ, **secrets}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    except FileNotFoundError as error:
        raise RecordError(
            f"a backup of a PostgreSQL database requires the program {program}", advice="install postgresql-client"
        ) from error
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[0]
        raise RecordError(f"{program} failed: {reason}", advice="nothing was changed")
    return done.stdout
