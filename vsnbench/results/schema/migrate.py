"""Migrates databases to the current schema with Alembic, and rejects newer schemas."""

import contextlib
import logging
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

from sqlalchemy import Connection, Engine, inspect, or_, select, text

from vsnbench.errors import RecordError
from vsnbench.files.atomic import part_path
from vsnbench.files.package_data import resource_directory
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.database_url import sqlite_path, sqlite_url
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import database_label, opened_engine, record_errors
from vsnbench.results.schema.tables import CampaignRow, ModelRow, RobotRow, SiteRow

if TYPE_CHECKING:
    from alembic.config import Config

logger = logging.getLogger(__name__)
HEAD: Final = max(path.name[:4] for path in (resource_directory("migrations") / "versions").glob("[0-9]*.py"))
"""Newest revision; a record that has it is opened without Alembic, which takes 0.2 s to load."""
NEWEST: Final = "newest.sql"
"""File with the result of all migrations, which take 0.2 s for an empty record."""


@dataclass(frozen=True, slots=True)
class SchemaState:
    """Schema revision of a database, and that of this version of vsnbench."""

    current: str | None
    """Revision of the database; None if it is empty."""
    head: str

    @property
    def up_to_date(self) -> bool:
        """Whether no migration is pending."""
        return self.current == self.head


def schema_state(engine: Engine) -> SchemaState:
    """Return the revision of a database.

    Raises:
        RecordError: the database cannot be read, is from a newer vsnbench, or is not a record.
    """
    with record_errors(engine), engine.connect() as connection:
        return SchemaState(HEAD, HEAD) if _is_head(connection) else _state(connection)


@contextmanager
def open_record(url: str, *, reads_copy: bool = True) -> Iterator[Engine]:
    """Open an existing record for reading, and close it at the end of the block.

    A file with an older schema stays as it is: an upgraded copy is read, which exists until the end of the block.

    Args:
        url: the database.
        reads_copy: False for commands that write to the record afterwards: they refuse a file with an older schema.

    Raises:
        UsageError: the URL is invalid.
        RecordError: no record exists, its schema is newer, or it has an older one and no copy of it is read.
    """
    with contextlib.ExitStack() as stack:
        engine = stack.enter_context(opened_engine(url, read_only=True))
        if reads_copy and _is_older_file(engine):
            engine = stack.enter_context(_upgraded_copy(url))
        _check_readable(engine)
        yield engine


def _is_older_file(engine: Engine) -> bool:
    if engine.dialect.name != "sqlite" or _has_head(engine):
        return False
    state = schema_state(engine)
    return state.current is not None and not state.up_to_date


@contextmanager
def _upgraded_copy(url: str) -> Iterator[Engine]:
    with ScratchDirectory("older") as scratch:
        copy = sqlite_url(scratch.path / "vsnbench.db")
        backup(url, scratch.path / "vsnbench.db")
        with opened_engine(copy) as engine:
            upgrade(engine, is_copy=True)
        logger.info("%s has an older schema; an upgraded copy is read", sqlite_path(url))
        with opened_engine(copy, read_only=True) as engine:
            yield engine


def _check_readable(engine: Engine) -> None:
    if _has_head(engine):
        _check_campaigns(engine)
        return
    state = schema_state(engine)
    if state.up_to_date:
        return
    if state.current is None:
        raise RecordError(f"the database {database_label(engine)} is empty", advice="`vsnbench run` adds data")
    raise RecordError(
        f"the database {database_label(engine)} has the older schema {state.current}, this version reads {state.head}",
        advice="`vsnbench db upgrade` upgrades it; make a copy first with `vsnbench db backup`",
    )


@cache
def _empty_record() -> bytes:
    """Return an empty record as the content of a file."""
    with contextlib.closing(sqlite3.connect(":memory:")) as database:
        database.executescript((resource_directory("migrations") / NEWEST).read_text(encoding="utf-8"))
        return database.serialize()


def newest_sql() -> str:
    """Return the SQL of an empty record, as the migrations make it."""
    with opened_engine("sqlite://") as engine, engine.connect() as connection:
        upgrade(engine)  # an in-memory database exists as long as its connection
        lines = "\n".join(_raw(connection).iterdump())
    return f"-- Written by scripts/make_docs.py from the migrations.\n{lines}\n"


def get_ready(url: str) -> None:
    """Prepare an empty record for a missing database, while the caller waits for other processes.

    Nothing is written yet, because the run may still be refused.
    """
    path = sqlite_path(url)
    if path is not None and not path.exists():
        _empty_record()


def create_record(url: str) -> None:
    """Write an empty record if there is no SQLite database.

    Concurrent processes, and file systems without hard links, leave it to `upgrade`.
    """
    path = sqlite_path(url)
    if path is None or path.exists() or not path.parent.is_dir():
        return
    part = part_path(path)
    with contextlib.suppress(OSError):  # another process has created it, or hard links are not supported
        try:
            part.write_bytes(_empty_record())
            os.link(part, path)
        finally:
            part.unlink(missing_ok=True)


@contextmanager
def record_in_memory() -> Iterator[Engine]:
    """Yield an empty record in memory."""
    with opened_engine("sqlite://") as engine:
        with engine.connect() as connection:
            _raw(connection).deserialize(_empty_record())
        yield engine  # its connections of this thread are the same


def upgrade(engine: Engine, *, is_copy: bool = False) -> SchemaState:
    """Migrate the database to the newest schema: all or nothing. A current database is only read.

    Args:
        engine: the database.
        is_copy: the database is a private copy, so that recorded live processes do not matter.

    Returns:
        The previous state.

    Raises:
        RecordError: as in `schema_state`; or the database cannot be written, or an older vsnbench is using it.
    """
    if _has_head(engine):
        return SchemaState(HEAD, HEAD)
    from alembic import command

    before = schema_state(engine)
    with record_errors(engine), engine.connect() as connection:
        sqlite = connection.dialect.name == "sqlite"
        if sqlite:
            # Rebuilding a table drops the old one, which foreign keys would prevent. The pragma has no effect inside a
            # transaction, so the driver's connection is used.
            _raw(connection).execute("PRAGMA foreign_keys = OFF")
        try:
            with connection.begin():
                if not sqlite:
                    # Of several processes on a server one migrates, and the others wait.
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


_ADVISORY_LOCK = 7_305_514_013


def _check_campaigns(engine: Engine) -> None:
    """Check that no campaign refers to a missing row, because it would be missing from every table."""
    query = (
        select(CampaignRow.id, ModelRow.id, RobotRow.id, SiteRow.id)
        .outerjoin(ModelRow, ModelRow.id == CampaignRow.model_id)
        .outerjoin(RobotRow, RobotRow.id == CampaignRow.robot_id)
        .outerjoin(SiteRow, SiteRow.id == CampaignRow.site_id)
        .where(or_(ModelRow.id.is_(None), RobotRow.id.is_(None), SiteRow.id.is_(None)))
        .order_by(CampaignRow.id)
    )
    with record_errors(engine), engine.connect() as connection:
        torn = connection.execute(query).first()
    if torn is not None:
        lacks = [name for name, found in zip(("model", "robot", "site"), torn[1:], strict=True) if found is None]
        raise RecordError(
            f"the database {database_label(engine)} is incomplete: the {' and the '.join(lacks)} of campaign {torn[0]} "
            "is missing, and the campaign would be missing from every table",
            advice="restore a backup",
        )


def _check_nobody_writes(connection: Connection) -> None:
    """Check that no other process is recording an episode."""
    from vsnbench.results.writing.provenance import this_process
    from vsnbench.results.writing.recovery import live_writers

    if _is_head(connection):  # another process has upgraded it while this one waited
        return
    if who := live_writers(connection, this_process()):
        raise RecordError(
            f"{who} is using the database {database_label(connection.engine)} with an older vsnbench; it was not "
            "upgraded",
            advice="repeat the command when that process has ended",
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
    # Read before the revision: another process may create the record between the two queries.
    tables = inspect(connection).get_table_names()
    try:
        current = MigrationContext.configure(connection).get_current_revision()
    except CommandError as error:  # several revisions
        raise RecordError(
            f"the database {database_label(connection.engine)} has several schema revisions ({error})",
            advice="restore a backup",
        ) from error
    if current is None:
        if tables:
            raise RecordError(
                f"the database {database_label(connection.engine)} holds other tables "
                f"({', '.join(sorted(tables)[:3])}) and no record of vsnbench",
                advice="choose another database",
            )
        return SchemaState(None, head)
    if current not in {script.revision for script in scripts.walk_revisions()}:
        raise RecordError(
            f"the database {database_label(connection.engine)} was written by a newer vsnbench (its schema is "
            f"{current}, this version knows up to {head})",
            advice="upgrade vsnbench, or choose another results directory",
        )
    return SchemaState(current, head)


def _check_foreign_keys(connection: Connection) -> None:
    orphans = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
    if orphans:
        table, row, parent, _ = orphans[0]
        raise RecordError(
            f"cannot upgrade the database {database_label(connection.engine)}: row {row} of {table} refers to a "
            f"missing row of {parent} ({len(orphans)} such rows); nothing was changed, restore a backup"
        )


def _raw(connection: Connection) -> sqlite3.Connection:
    raw = connection.connection.dbapi_connection
    if not isinstance(raw, sqlite3.Connection):
        raise TypeError(f"not an SQLite connection: {raw!r}")
    return raw
