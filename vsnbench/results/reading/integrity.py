"""Finds invalid data in a record after an unexpected error, to distinguish bad records from bugs.

A database can come from anywhere, and SQLite accepts any value in any column. Checking every row before every command
would be slow, so an unexpected error is traced to the row that caused it. Without such a row the error keeps its
traceback.
"""

import math
import sqlite3
from collections.abc import Callable, Iterator, Sequence
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
    LargeBinary,
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

from vsnbench.errors import VsnbenchError
from vsnbench.files.bounded_json import parse_json
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import redacted_url, sqlite_path
from vsnbench.results.schema.base import TableBase, UtcDateTime
from vsnbench.results.schema.engine import opened_engine, opened_urls
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.sites.goals import SiteGoal
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line
from vsnbench.values.encoding.images import picture_size
from vsnbench.values.fix import PoseSource
from vsnbench.values.goal import GoalKind
from vsnbench.values.motion_result import CollisionSource
from vsnbench.values.movement import Action
from vsnbench.values.robot_profile import RobotProfile

LARGEST_NUMBER: Final = 1e12
"""Limit for lengths in metres, angles in radians and times in seconds."""
YEARS: Final = range(1970, 2200)
_UNREADABLE: Final = (sqlite3.Error, ValueError, TypeError, ArithmeticError, AttributeError, RecursionError)
"""Further errors of SQLite's driver and SQLAlchemy for damaged files; UnicodeDecodeError is one."""

_WORDS: dict[str, type[StrEnum]] = {
    "action": Action,
    "goal.kind": GoalKind,
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
    "goal.content": (SiteGoal, SiteGoal.model_validate),
    "robot.profile": (RobotProfile, RobotProfile.model_validate),
    "campaign.protocol": (ProtocolParameters, ProtocolParameters.from_record),
}
"""JSON columns with the parser of their content."""


def fault_of_opened_records() -> str:
    """Return what is wrong with a record that this process has opened, or an empty string."""
    for url in opened_urls():
        file = sqlite_path(url)
        if file is not None and not file.exists():
            continue  # a temporary copy that no longer exists
        try:
            if fault := record_fault(url):
                return (
                    f"the record {redacted_url(url)} has invalid content: {fault}; restore a backup, or "
                    "do not use this record"
                )
        except VsnbenchError as error:
            return str(error)
    return ""


def record_fault(url: str) -> str:
    """Return the first invalid value of a record, or an empty string.

    Raises:
        RecordError: the database cannot be read at all.
    """
    try:
        with opened_engine(url, read_only=True) as engine, engine.connect() as connection:
            return next(record_faults(connection), "")
    except SQLAlchemyError as error:
        return error_line(getattr(error, "orig", None) or error, named=False)
    except _UNREADABLE as error:
        return f"it cannot be read ({error_line(error)})"


def record_faults(connection: Connection) -> Iterator[str]:
    """Yield every invalid value of a record, with its table, row and column."""
    there = set(inspect(connection).get_table_names())
    for table in TableBase.metadata.sorted_tables:
        if table.name not in there:
            continue
        known = {column["name"] for column in inspect(connection).get_columns(table.name)}
        yield from _table_faults(connection, table, [column for column in table.columns if column.name in known])
    if connection.dialect.name == "sqlite":
        for child, row, parent, _ in connection.execute(text("PRAGMA foreign_key_check")):
            yield f"row {row} of {child} refers to a missing row of {parent}"


def _table_faults(connection: Connection, table: Table, columns: Sequence[Column[Any]]) -> Iterator[str]:
    stored = [cast(column, Text) if _is_json(column) else type_coerce(column, NullType()) for column in columns]
    keys = [type_coerce(key, NullType()) for key in table.primary_key.columns]
    checks = [(column, _check_of(table, column)) for column in columns]
    for row in connection.execution_options(yield_per=5_000).execute(select(*keys, *stored)):
        for (column, check), value in zip(checks, row[len(keys) :], strict=True):
            wrong = ("missing, but required" if not column.nullable else "") if value is None else check(value)
            if wrong:
                where = "/".join(str(part)[:20] for part in row[: len(keys)])
                yield f"{table.name} {where}: {column.name} is {wrong}"


def _check_of(table: Table, column: Column[Any]) -> Callable[[Any], str]:
    """Return a function that describes why a value of a column is invalid, or returns an empty string."""
    kind = column.type
    if _is_json(column):
        return lambda value: _json_fault(value, table.name, column.name)
    if isinstance(kind, UtcDateTime):
        return _moment_fault
    if isinstance(kind, Boolean):
        return lambda value: "" if value in (0, 1) else f"{_shown(value)}, expected 0 or 1"
    if isinstance(kind, Integer):
        largest = 2**63 if isinstance(kind, BigInteger) else 2**31
        return lambda value: (
            "" if isinstance(value, int) and abs(value) < largest else f"{_shown(value)}, not an integer"
        )
    if isinstance(kind, Float):
        return lambda value: "" if _is_number(value) else f"{_shown(value)}, not a plausible number"
    if isinstance(kind, LargeBinary):
        return lambda value: "" if isinstance(value, bytes) and picture_size(value) else "not a PNG or JPEG image"
    words = _WORDS.get(f"{table.name}.{column.name}") or _WORDS.get(column.name)
    if words is None:
        return lambda value: "" if isinstance(value, str) else f"{_shown(value)}, not text"
    return lambda value: "" if value in set(words) else f"{_shown(value)}, not one of {', '.join(words)}"


def _json_fault(value: Any, table: str, column: str) -> str:
    try:
        content = parse_json(value) if isinstance(value, str) else None
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict | list):
        return f"{_shown(value)}, not valid JSON"
    model, read = _CONTENT.get(f"{table}.{column}", (None, None))
    if model is not None and read is not None and not (isinstance(content, dict) and _known_by_name(content, model)):
        try:
            read(content)
        except (ValidationError, RecursionError, AttributeError) as error:
            return f"invalid ({str(error).partition(chr(10))[0]})"
    return ""


def _known_by_name(content: dict[str, Any], model: type[BaseModel]) -> bool:
    """Return whether a site or model was imported with only its name."""
    needed = {name for name, field in model.model_fields.items() if field.is_required()} - {"name", "title"}
    return bool(needed) and not any(content.get(name) for name in needed)


def _moment_fault(value: Any) -> str:
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value)
        except ValueError:
            return f"{_shown(value)}, not a valid time"
    return "" if isinstance(value, datetime) and value.year in YEARS else f"{_shown(value)}, not a valid time"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < LARGEST_NUMBER


def _is_json(column: Column[Any]) -> bool:
    return isinstance(column.type, JSON)


def _shown(value: Any) -> str:
    return repr(value)[:60]
