"""Converts values to table columns and back, and inserts rows safely with concurrent processes."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, fields
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, cast

from sqlalchemy import Connection, Table, insert, select
from sqlalchemy.dialects import postgresql, sqlite

from vsnbench.protocol.judge import GoalDistance, Verdict
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.results.schema.base import TableBase
from vsnbench.results.schema.tables import EpisodeRow
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import MeasuredPlacement
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from vsnbench.results.writing.provenance import Provenance

Row = dict[str, Any]
"""Column name -> value."""


AT_START, AT_STOP = "start", "stop"
"""Moments at which a pose is measured."""
_AT_ONCE = 500


def parts(numbers: Iterable[Any]) -> Iterator[list[Any]]:
    """Yield sorted values in lists that are short enough for `IN` in every database."""
    ordered = sorted(numbers)
    return (ordered[first : first + _AT_ONCE] for first in range(0, len(ordered), _AT_ONCE))


def columns_of_fields(table: type[TableBase], kind: type[Any]) -> list[Any]:
    """Return the columns of a table that have the names of a dataclass's fields."""
    columns = table.__table__.c
    return [columns[field.name] for field in fields(kind) if field.name in columns]


def _columns_of(value: Any, table: type[TableBase]) -> Row:
    """Return a dataclass's fields that have the names of columns: text that databases accept, and finite numbers."""
    safe: dict[type, Any] = {str: text, float: number}
    named = ((column.name, getattr(value, column.name)) for column in columns_of_fields(table, type(value)))
    return {name: safe.get(type(part), lambda same: same)(part) for name, part in named}


def number(value: float | None) -> float | None:
    """Return a number for the record: NULL if it is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


def text(value: str) -> str:
    """Return text that every database accepts: without NUL characters and lone surrogates."""
    return value.replace("\x00", "\N{REPLACEMENT CHARACTER}").encode("utf-8", "replace").decode("utf-8")


def pose_columns(prefix: str, pose: Pose | None) -> Row:
    """Return `<prefix>_x_m`, `_y_m` and `_heading_rad`."""
    return {f"{prefix}_{name}": getattr(pose, name) if pose else None for name in ("x_m", "y_m", "heading_rad")}


def pose_of_columns(x_m: float | None, y_m: float | None, heading_rad: float | None) -> Pose | None:
    """Return the pose of three columns; None unless it is complete."""
    return None if x_m is None or y_m is None or heading_rad is None else Pose(x_m, y_m, heading_rad)


def fix_of_columns(x_m: float | None, y_m: float | None, heading_rad: float | None, source: str | None) -> Fix | None:
    """Return the pose of three columns with its source; None unless it is complete."""
    pose = pose_of_columns(x_m, y_m, heading_rad)
    return None if pose is None or source is None else Fix(pose, PoseSource(source))


def _distance_columns(verdict: Verdict | None, distance_column: str) -> Row:
    """Return the columns of the distance of a verdict; NULL without one."""
    distance = verdict.distance if verdict else None
    return {
        distance_column: number(distance.distance_m) if distance else None,
        "distance_source": distance.source.value if distance else None,
        "goal_instance": distance.instance if distance else None,
        "goal_in_sight": distance.in_sight if distance else None,
    }


def process_row(given: "Provenance") -> Row:
    """Return the row of a writing process."""
    return {
        "host": text(given.identity.host),
        "pid": given.identity.pid,
        "boot_id": given.identity.boot_id,
        "pid_namespace": given.identity.pid_namespace,
        "start_ticks": given.identity.start_ticks,
        "started_at": given.started_at,
        "operator": text(given.operator),
        "command": text(given.command),
        "vsnbench_version": given.vsnbench_version,
        "git_commit": given.git_commit,
        "git_dirty": given.git_dirty,
        "packages": dict(given.packages),
        "platform": dict(given.platform),
    }


def event_row(kind: str, words: str, *, author: str = "", **where: int | None) -> Row:
    """Return the row of an event that happens now, with the columns of the campaign, episode or step."""
    return {"kind": kind, "author": text(author), "text": text(words), "created_at": datetime.now(UTC), **where}


def episode_begin_row(begin: EpisodeBegin) -> Row:
    """Return the columns set at an episode's beginning."""
    return {
        **_columns_of(begin, EpisodeRow),
        "started_at": begin.started_at or datetime.now(UTC),
        "geodesic_start_m": number(begin.shortest_m),
        **({} if begin.has_images else {"images_directory": ""}),
    }


def measured_row(episode_id: int, measured: MeasuredPlacement, author: str) -> Row:
    """Return the row of a placement at the mark, measured and accepted now."""
    return {"moment": AT_START, **_measured_columns(episode_id, measured, author), "words": text(measured.headline)}


def stop_row(episode_id: int, stop: StopPose) -> Row:
    """Return the row of a pose measured now, after STOP."""
    return {
        "moment": AT_STOP,
        **_measured_columns(episode_id, stop.placement, ""),
        "words": text(stop.text),
        **_range_columns("distance", stop.measured),
        **_range_columns("odometry", stop.odometry),
        "verdicts_differ": stop.verdicts_differ,
    }


def _range_columns(prefix: str, distance: GoalDistance | None) -> Row:
    low_m, high_m = (None, None) if distance is None or distance.range_m is None else distance.range_m
    values = {"": None if distance is None else distance.distance_m, "_low": low_m, "_high": high_m}
    return {f"{prefix}{part}_m": number(value) for part, value in values.items()}


def _measured_columns(episode_id: int, measured: MeasuredPlacement, author: str) -> Row:
    offset = measured.offset
    return {
        "episode_id": episode_id,
        "created_at": datetime.now(UTC),
        "author": text(author),
        "method": measured.method.value,
        "looks": measured.looks,
        **{name: getattr(measured.pose, name) for name in ("x_m", "y_m", "heading_rad")},
        "covariance": list(measured.covariance.values),
        "ahead_m": offset.x_m,
        "left_m": offset.y_m,
        "turn_rad": offset.heading_rad,
        "determined": measured.determined,
        "within_tolerance": measured.within_tolerance,
        "undetermined": [text(direction) for direction in measured.undetermined],
        "moved": [text(name) for name in measured.moved],
        "depth_scale": measured.depth_scale,
    }


def episode_end_row(end: EpisodeEnd) -> Row:
    """Return the columns set at an episode's end."""
    return {
        **_columns_of(end, EpisodeRow),
        "ended_at": end.ended_at or datetime.now(UTC),
        "end_reason": end.end_reason.value,
        "path_length_m": number(end.path_m),
        "geodesic_end_m": number(end.remaining_m),
        **_distance_columns(end.verdict, "distance_to_goal_m"),
        **pose_columns("final", end.final.pose if end.final else None),
        "final_source": end.final.source.value if end.final else None,
        "legs": [asdict(leg) for leg in end.legs] or None,
    }


def verdict_row(
    episode_id: int, verdict: Verdict, *, author: str, source: str, note: str = "", proposed: bool = False
) -> Row:
    """Return the row of a verdict given now."""
    return {
        "episode_id": episode_id,
        "created_at": datetime.now(UTC),
        "proposed": proposed,
        "success": verdict.success,
        "end_reason": verdict.end_reason.value,
        **_distance_columns(verdict, "distance_m"),
        "author": text(author),
        "source": source,
        "reason": text(verdict.text),
        "note": text(note),
    }


def insert_row(connection: Connection, table: type[TableBase], row: Row) -> int:
    """Insert a row and return its id."""
    key: Any = connection.execute(insert(cast("Table", table.__table__)), row).inserted_primary_key
    return int(key[0])


def find_or_insert(connection: Connection, table: type[TableBase], row: Row, unique: str) -> int:
    """Return the id of the row with this value in its unique column, inserting it if needed.

    A concurrent insertion of the same row is waited for.
    """
    columns = table.__table__.c
    wanted = select(columns.id).where(columns[unique] == row[unique])
    found: int | None = connection.execute(wanted).scalar()
    if found is None:
        connection.execute(insert_if_absent(connection, table, [unique]), row)
        found = connection.execute(wanted).scalar_one()
    return found


def insert_if_absent(connection: Connection, table: type[TableBase], unique: list[str]) -> Any:
    """Return an INSERT that ignores existing rows."""
    dialect = postgresql if connection.dialect.name == "postgresql" else sqlite
    return dialect.insert(table).on_conflict_do_nothing(index_elements=unique)
