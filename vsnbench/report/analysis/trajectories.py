"""Reads the paths of the robots in the site's frame."""

import math
from dataclasses import dataclass

from sqlalchemy import Engine, select

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import Episode, Step
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True)
class Track:
    """Path of the robot in one episode."""

    episode: int
    goal: str
    start: int
    success: bool
    end_reason: str
    points: tuple[tuple[float, float], ...]
    """(x, y) in the site's frame, metres, starting at the start."""


def read_tracks(engine: Engine, record: ReportData, condition: Condition, max_per_goal: int = 30) -> tuple[Track, ...]:
    """Read the paths of the counted episodes, evenly sampled above `max_per_goal` per goal.

    Poses in the site are used as recorded; without them odometry is added to the start pose.

    Raises:
        RecordError: the database cannot be used.
    """
    rows = record.counted(condition)
    if rows.empty:
        return ()
    strides = {goal: max(1, math.ceil(len(mine) / max_per_goal)) for goal, mine in rows.groupby("goal", observed=True)}
    rank = rows.groupby("goal", observed=True).cumcount()
    chosen = rows[(rank % rows["goal"].astype(str).map(strides).astype(int)) == 0]
    numbers = [int(number) for number in chosen["episode"]]
    with record_errors(engine), engine.connect() as connection:
        found = connection.execute(
            select(
                *(Episode.id, Episode.start_x_m, Episode.start_y_m, Episode.start_heading_rad),
                *(Step.world_x_m, Step.world_y_m, Step.after_x_m, Step.after_y_m),
            )
            .join(Step, Step.episode_id == Episode.id)
            .where(Episode.id.in_(numbers))
            .order_by(Step.episode_id, Step.number)
        ).all()
    points: dict[int, list[tuple[float, float]]] = {}
    for number, x, y, heading, world_x, world_y, after_x, after_y in found:
        start = None if x is None or y is None or heading is None else Pose(x, y, heading)
        track = points.setdefault(number, [start.position] if start else [])
        if world_x is not None and world_y is not None:
            track.append((world_x, world_y))
        elif start and after_x is not None and after_y is not None:
            track.append(start.compose(Pose(after_x, after_y)).position)
    columns = (chosen["goal"], chosen["start"], chosen["success"], chosen["end_reason"])
    return tuple(
        Track(number, str(goal), int(start), bool(success), str(reason), tuple(points[number]))
        for number, goal, start, success, reason in zip(numbers, *columns, strict=True)
        if points.get(number)
    )
