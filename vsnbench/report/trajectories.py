"""Reads where robots went: the tracks of the episodes of one condition, in the site's frame."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Engine, select

from vsnbench.database.engine import record_errors
from vsnbench.database.tables import Episode, Step
from vsnbench.report.record import Condition, Record


@dataclass(frozen=True, slots=True)
class Track:
    """Where the robot went in one episode."""

    episode: int
    goal: str
    start: int
    success: bool
    end_reason: str
    points: tuple[tuple[float, float], ...]
    """(x, y) in the site's frame, metres, from the start on."""


def read_tracks(engine: Engine, record: Record, condition: Condition, most_a_goal: int = 60) -> tuple[Track, ...]:
    """Read the tracks of the episodes that count, evenly picked where there are more than `most_a_goal` of a goal.

    A pose in the site is taken as recorded; where there is none, odometry is laid at the episode's start.

    Raises:
        RecordError: the database cannot be used.
    """
    rows = record.counted(condition)
    chosen = []
    for _, mine in rows.groupby("goal", observed=True):
        stride = max(1, math.ceil(len(mine) / most_a_goal))
        chosen += list(mine.iloc[::stride].itertuples(index=False))
    with record_errors(engine), engine.connect() as connection:
        found = connection.execute(
            select(
                *(Episode.id, Episode.start_x_m, Episode.start_y_m, Episode.start_heading_rad),
                *(Step.world_x_m, Step.world_y_m, Step.after_x_m, Step.after_y_m),
            )
            .join(Step, Step.episode_id == Episode.id)
            .where(Episode.id.in_([row.episode for row in chosen]))
            .order_by(Step.episode_id, Step.number)
        ).all()
    points: dict[int, list[tuple[float, float]]] = {}
    for number, x, y, heading, world_x, world_y, after_x, after_y in found:
        track = points.setdefault(number, [(x, y)] if x is not None and y is not None else [])
        if world_x is not None and world_y is not None:
            track.append((world_x, world_y))
        elif None not in (x, y, heading, after_x, after_y):
            cos, sin = math.cos(heading), math.sin(heading)
            track.append((x + cos * after_x - sin * after_y, y + sin * after_x + cos * after_y))
    return tuple(
        Track(
            row.episode, str(row.goal), row.start, bool(row.success), str(row.end_reason), _finite(points[row.episode])
        )
        for row in chosen
        if points.get(row.episode)
    )


def _finite(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    return tuple(point for point in points if all(map(math.isfinite, point)))
