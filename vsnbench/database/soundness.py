"""Says what in a record no vsnbench wrote: asked only after something failed, to tell a bad record from a bug of ours.

A database can come from anybody, and SQLite takes any value in any column. Checking every row before every command
would cost more than the command; so a failure that nobody expected is traced to the row that caused it, here, and where
there is none the failure keeps its traceback.
"""

import json
import math
from collections.abc import Callable, Iterator
from datetime import datetime
from enum import StrEnum
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    Connection,
    Float,
    Integer,
    Table,
    Text,
    cast,
    inspect,
    select,
    text,
    type_coerce,
)
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.types import NullType

from vsnbench.database.column_types import UtcDateTime
from vsnbench.database.engine import open_engine, opened_urls
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.tables import Base
from vsnbench.database_url import shown_url, sqlite_path
from vsnbench.errors import VsnbenchError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.motion_result import CollisionSource
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site

LARGEST_NUMBER: Final = 1e12
"""Lengths are in metres, angles in radians, times in seconds since the robot started or since 1970."""
YEARS: Final = range(1970, 2200)

_WORDS: dict[str, type[StrEnum]] = {
    "action": Action,
    "end_reason": EndReason,
    "state": EpisodeState,
    "start_source": PoseSource,
    "world_source": PoseSource,
    "final_source": PoseSource,
    "distance_source": PoseSource,
    "collision_source": CollisionSource,
}
_CONTENT: dict[str, tuple[type[BaseModel], Callable[[Any], object]]] = {
    "site.content": (Site, Site.model_validate),
    "robot.profile": (RobotProfile, RobotProfile.model_validate),
    "campaign.protocol": (ProtocolParameters, ProtocolParameters.from_record),
}
"""Columns that hold a whole value, and how it is read back from a record of any age."""


def fault_of_opened_records() -> str:
    """Return, in a line, what is wrong with a record that this process has opened; empty when nothing is."""
    for url in opened_urls():
        file = sqlite_path(url)
        if file is not None and not file.exists():
            continue  # a copy that was looked into and is gone
        try:
            if fault := record_fault(url):
                return (
                    f"the record {shown_url(url)} holds what no vsnbench writes: {fault}; restore a backup, or leave "
                    "this record alone"
                )
        except VsnbenchError as error:
            return str(error)
    return ""


def record_fault(url: str) -> str:
    """Return the first thing in a record that no vsnbench writes; empty when there is none.

    Raises:
        RecordError: the database cannot be read at all.
    """
    engine = open_engine(url, read_only=True)
    try:
        with engine.connect() as connection:
            return next(_faults(connection), "")
    except SQLAlchemyError as error:
        return str(getattr(error, "orig", None) or error).partition("\n")[0][:200]
    finally:
        engine.dispose()


def _faults(connection: Connection) -> Iterator[str]:
    there = set(inspect(connection).get_table_names())
    for table in Base.metadata.sorted_tables:
        if table.name not in there:
            continue
        known = {column["name"] for column in inspect(connection).get_columns(table.name)}
        for column in table.columns:
            if column.name in known:
                yield from _column_faults(connection, table, column)
    if connection.dialect.name == "sqlite":
        for (trigger,) in connection.execute(text("SELECT name FROM sqlite_master WHERE type = 'trigger'")):
            yield f"a trigger, {_shown(trigger)}, that changes rows behind our back"
        for child, row, parent, _ in connection.execute(text("PRAGMA foreign_key_check")):
            yield f"row {row} of {child} points to a row of {parent} that is not there"


def _column_faults(connection: Connection, table: Table, column: Column[Any]) -> Iterator[str]:
    as_stored = cast(column, Text) if _is_json(column) else type_coerce(column, NullType())
    keys = [type_coerce(key, NullType()) for key in table.primary_key.columns]
    rows = connection.execution_options(yield_per=5_000).execute(select(as_stored, *keys))
    check = _check_of(table, column)
    for value, *key in rows:
        wrong = ("nothing, where something belongs" if not column.nullable else "") if value is None else check(value)
        if wrong:
            yield f"{table.name} {'/'.join(str(part)[:20] for part in key)}: {column.name} is {wrong}"


def _check_of(table: Table, column: Column[Any]) -> Callable[[Any], str]:
    """Return what says, in words, why a value of a column is none of ours."""
    kind = column.type
    if _is_json(column):
        return lambda value: _json_fault(value, table.name, column.name)
    if isinstance(kind, UtcDateTime):
        return _moment_fault
    if isinstance(kind, Boolean):
        return lambda value: "" if value in (0, 1) else f"{_shown(value)}, neither true nor false"
    if isinstance(kind, Integer):
        largest = 2**63 if isinstance(kind, BigInteger) else 2**31
        return lambda value: "" if isinstance(value, int) and abs(value) < largest else f"{_shown(value)}, no number"
    if isinstance(kind, Float):
        return lambda value: "" if _is_number(value) else f"{_shown(value)}, no number that could be measured"
    words = _WORDS.get(column.name)
    if words is None:
        return lambda value: "" if isinstance(value, str) else f"{_shown(value)}, no text"
    return lambda value: "" if value in set(words) else f"{_shown(value)}, not one of {', '.join(words)}"


def _json_fault(value: Any, table: str, column: str) -> str:
    try:
        content = json.loads(value) if isinstance(value, str) else None
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict | list):
        return f"{_shown(value)}, no JSON of ours"
    model, read = _CONTENT.get(f"{table}.{column}", (None, None))
    if model is not None and read is not None and not (isinstance(content, dict) and _known_by_name(content, model)):
        try:
            read(content)
        except (ValidationError, RecursionError, AttributeError) as error:
            return f"none that can be used ({str(error).partition(chr(10))[0]})"
    return ""


def _known_by_name(content: dict[str, Any], model: type[BaseModel]) -> bool:
    """Say whether a place or an agent was imported, of which its name alone is known."""
    needed = {name for name, field in model.model_fields.items() if field.is_required()} - {"name", "title"}
    return bool(needed) and not any(content.get(name) for name in needed)


def _moment_fault(value: Any) -> str:
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value)
        except ValueError:
            return f"{_shown(value)}, no time"
    return "" if isinstance(value, datetime) and value.year in YEARS else f"{_shown(value)}, no time"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < LARGEST_NUMBER


def _is_json(column: Column[Any]) -> bool:
    return isinstance(column.type, JSON)


def _shown(value: Any) -> str:
    return repr(value)[:60]
