"""Brings a database to this version's schema with Alembic, refuses one from a newer vsnbench, and makes backups."""

import contextlib
import os
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sqlalchemy import Connection, Engine, inspect, or_, select, text

from vsnbench.database.engine import open_engine, record_errors, shown_database, sqlite_reader
from vsnbench.database.tables import Campaign, Model, Robot, Site
from vsnbench.database_url import libpq_connection, sqlite_path
from vsnbench.errors import RecordError
from vsnbench.resources import resource_directory
from vsnbench.whole_files import part_path, whole_file

if TYPE_CHECKING:
    from alembic.config import Config

HEAD: Final = "0005"
"""The newest revision: a record that has it is opened without Alembic, which takes a fifth of a second to load."""


_empty_records: list[bytes] = []
"""One that was made in memory, as a file has it."""


@dataclass(frozen=True, slots=True)
class SchemaState:
    """Where a database stands on the way to this version's schema."""

    current: str | None
    """Revision of the database; None when it is empty."""
    head: str
    """Revision that this version of vsnbench works with."""
    pending: tuple[str, ...]
    """Revisions between the two, in order."""

    @property
    def up_to_date(self) -> bool:
        """Whether nothing is left to do."""
        return self.current == self.head


def schema_state(engine: Engine) -> SchemaState:
    """Say which revision a database has and which ones it lacks.

    Raises:
        RecordError: the database cannot be read, is from a newer vsnbench, or is not a record at all.
    """
    with record_errors(engine), engine.connect() as connection:
        return _state(connection)


@contextmanager
def open_record(url: str) -> Iterator[Engine]:
    """Open an existing record for reading only; it is closed again at the block's end.

    Raises:
        UsageError: the URL is not one.
        RecordError: there is no record, or its schema is not this version's; the message says what to do.
    """
    engine = open_engine(url, read_only=True)
    try:
        _check_readable(engine)
        yield engine
    finally:
        engine.dispose()


def _check_readable(engine: Engine) -> None:
    if _has_head(engine):
        _check_campaigns(engine)
        return
    state = schema_state(engine)
    if state.up_to_date:
        return
    if state.current is None:
        raise RecordError(f"the database {shown_database(engine)} is empty", advice="`vsnbench run` fills it")
    raise RecordError(
        f"the database {shown_database(engine)} has the older schema {state.current}, this version reads {state.head}",
        advice="`vsnbench db upgrade` brings it up to date, `vsnbench db backup` first keeps a copy",
    )


def get_ready(url: str) -> None:
    """Make an empty record in memory for a database that is not there yet: whoever waits for others does it meanwhile.

    Nothing is written: what is about to be run may still be refused.
    """
    path = sqlite_path(url)
    if path is None or path.exists() or _empty_records:
        return
    engine = open_engine("sqlite://")
    with engine.connect() as connection:  # a database in memory lives as long as its connection
        upgrade(engine)
        _empty_records.append(_raw(connection).serialize())
    engine.dispose()


def begin_record(url: str) -> None:
    """Write the empty record that was made in memory, where there is no database yet; else nothing happens.

    Of several processes one is first; the others, and one whose disk links no files, leave it to `upgrade`.
    """
    path = sqlite_path(url)
    if path is None or path.exists() or not _empty_records:
        return
    part = part_path(path)
    with contextlib.suppress(OSError):  # another has begun it, or the disk links no files
        try:
            part.write_bytes(_empty_records[0])
            os.link(part, path)
        finally:
            part.unlink(missing_ok=True)


def upgrade(engine: Engine, *, is_copy: bool = False) -> SchemaState:
    """Bring the database to the newest schema, all of it or nothing; an up-to-date one is only read.

    Args:
        engine: the database.
        is_copy: nobody else has it open, whoever was at it when it was copied.

    Returns:
        The state before.

    Raises:
        RecordError: as for `schema_state`, the database cannot be written, or somebody is at it with an older vsnbench.
    """
    if _has_head(engine):
        return SchemaState(HEAD, HEAD, ())
    from alembic import command

    before = schema_state(engine)
    with record_errors(engine), engine.connect() as connection:
        sqlite = connection.dialect.name == "sqlite"
        if sqlite:
            # A rebuilt table drops its old self: with foreign keys on, that would touch every row that points to it.
            # The pragma does nothing inside a transaction, hence the driver's own connection.
            _raw(connection).execute("PRAGMA foreign_keys = OFF")
        try:
            with connection.begin():
                if not sqlite:
                    # Several robots may start at once on one server: one migrates, the others wait and find it done.
                    connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_ADVISORY_LOCK})")
                if before.current is not None and not is_copy:
                    _check_nobody_writes(connection)
                config = _config()
                config.attributes["connection"] = connection
                command.upgrade(config, "head")
                if sqlite:
                    _check_foreign_keys(connection)
        finally:
            if sqlite:
                _raw(connection).execute("PRAGMA foreign_keys = ON")
    return before


def backup(url: str, target: Path) -> None:
    """Copy the database to `target` while others may be writing; the file appears whole or not at all.

    Args:
        url: the database; SQLite is copied as a file, PostgreSQL through `pg_dump` in its custom format.
        target: must not exist.

    Raises:
        RecordError: the copy cannot be made.
    """
    if target.exists():
        raise RecordError(f"{target} exists already", advice="name a new file for the backup")
    if not target.parent.is_dir():
        raise RecordError(
            f"there is no directory {target.parent} for the backup", advice="make it first, or name another place"
        )
    source = sqlite_path(url)
    try:
        with whole_file(target) as part:
            if source is None:
                _dump_postgresql(url, part)
            else:
                _copy_sqlite(source, part)
    except sqlite3.Error as error:
        raise RecordError(f"cannot write the backup {target}: {error}") from error


_ADVISORY_LOCK = 7_305_514_013


def _check_campaigns(engine: Engine) -> None:
    """See that no campaign would drop out of every table because what it ran on is not there.

    Raises:
        RecordError: there is such a campaign; the database keeps its keys by itself, so somebody took the row out.
    """
    query = (
        select(Campaign.id, Model.id, Robot.id, Site.id)
        .outerjoin(Model, Model.id == Campaign.model_id)
        .outerjoin(Robot, Robot.id == Campaign.robot_id)
        .outerjoin(Site, Site.id == Campaign.site_id)
        .where(or_(Model.id.is_(None), Robot.id.is_(None), Site.id.is_(None)))
        .order_by(Campaign.id)
    )
    with record_errors(engine), engine.connect() as connection:
        torn = connection.execute(query).first()
    if torn is not None:
        lacks = [name for name, found in zip(("model", "robot", "site"), torn[1:], strict=True) if found is None]
        raise RecordError(
            f"the database {shown_database(engine)} is not whole: the {' and the '.join(lacks)} of campaign {torn[0]} "
            "is not in it, and the campaign would be missing from every table",
            advice="restore a backup",
        )


def _check_nobody_writes(connection: Connection) -> None:
    """See that no robot would be left without its record in the middle of an episode.

    Raises:
        RecordError: an older vsnbench is at it.
    """
    from vsnbench.database.provenance import this_process
    from vsnbench.database.recovery import who_writes

    if _is_head(connection):  # whoever had waited here before has upgraded it meanwhile
        return
    if who := who_writes(connection, this_process()):
        raise RecordError(
            f"{who} is still at the database {shown_database(connection.engine)} with an older vsnbench; it was not "
            "upgraded",
            advice="type the same again when that has ended",
        )


def _has_head(engine: Engine) -> bool:
    with record_errors(engine), engine.connect() as connection:
        return _is_head(connection)


def _is_head(connection: Connection) -> bool:
    if not inspect(connection).has_table("alembic_version"):
        return False
    return list(connection.scalars(text("SELECT version_num FROM alembic_version"))) == [HEAD]


def _config() -> "Config":
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(resource_directory("migrations")).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    return config


def _state(connection: Connection) -> SchemaState:
    from alembic.runtime.migration import MigrationContext
    from alembic.script import ScriptDirectory
    from alembic.util import CommandError

    scripts = ScriptDirectory.from_config(_config())
    head = scripts.get_current_head() or ""
    order = [script.revision for script in reversed(list(scripts.walk_revisions()))]
    try:
        current = MigrationContext.configure(connection).get_current_revision()
    except CommandError as error:  # two revisions at once
        raise RecordError(
            f"the database {shown_database(connection.engine)} says that it has several schemas at once ({error})",
            advice="restore a backup",
        ) from error
    if current is None:
        tables = inspect(connection).get_table_names()
        if tables:
            raise RecordError(
                f"the database {shown_database(connection.engine)} holds other "
                f"tables ({', '.join(sorted(tables)[:3])}) and no "
                "record of vsnbench",
                advice="choose another database",
            )
        return SchemaState(None, head, tuple(order))
    if current not in order:
        raise RecordError(
            f"the database {shown_database(connection.engine)} was written by a newer vsnbench "
            f"(its schema is {current}, this "
            f"version knows up to {head})",
            advice="upgrade vsnbench, or choose another results directory",
        )
    return SchemaState(current, head, tuple(order[order.index(current) + 1 :]))


def _check_foreign_keys(connection: Connection) -> None:
    orphans = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
    if orphans:
        table, row, parent, _ = orphans[0]
        raise RecordError(
            f"cannot upgrade the database {shown_database(connection.engine)}: row {row} of {table} points to a "
            f"row of {parent} "
            f"that is not there ({len(orphans)} such rows); nothing was changed, restore a backup"
        )


def _raw(connection: Connection) -> sqlite3.Connection:
    raw = connection.connection.dbapi_connection
    if not isinstance(raw, sqlite3.Connection):
        raise TypeError(f"not an SQLite connection: {raw!r}")
    return raw


def _copy_sqlite(source: Path, target: Path) -> None:
    if not source.is_file():
        raise RecordError(f"there is no record at {source}: nothing to back up")
    with closing(sqlite_reader(source)()) as database, closing(sqlite3.connect(target)) as copy:
        database.backup(copy)
        # One file, complete in itself: a copy in WAL mode would want its companions.
        copy.execute("PRAGMA journal_mode = DELETE")
        (verdict,) = copy.execute("PRAGMA quick_check").fetchone()
    if verdict != "ok":
        raise RecordError(
            f"the database {source} is damaged ({verdict}): no copy was made of it", advice="restore an earlier backup"
        )


def _dump_postgresql(url: str, target: Path) -> None:
    connection, secrets = libpq_connection(url)
    try:
        done = subprocess.run(
            ["pg_dump", "--no-password", "--format=custom", f"--file={target}", f"--dbname={connection}"],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **secrets},
        )
    except FileNotFoundError as error:
        raise RecordError(
            "a backup of PostgreSQL needs its program pg_dump", advice="install postgresql-client"
        ) from error
    if done.returncode:
        raise RecordError(f"pg_dump failed: {(done.stderr.strip().splitlines() or ['no reason given'])[0]}")
