"""Reads the paths of the robots in the site's frame."""

import math
from dataclasses import dataclass

from sqlalchemy import Engine

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.courses import read_courses
from vsnbench.report.analysis.episodes_frame import ReportData


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
    """
    rows = record.counted(condition)
    if rows.empty:
        return ()
    strides = {goal: max(1, math.ceil(len(mine) / max_per_goal)) for goal, mine in rows.groupby("goal", observed=True)}
    rank = rows.groupby("goal", observed=True).cumcount()
    chosen = rows[(rank % rows["goal"].astype(str).map(strides).astype(int)) == 0]
    numbers = [int(number) for number in chosen["episode"]]
    courses = read_courses(engine, numbers)
    columns = (chosen["goal"], chosen["start"], chosen["success"], chosen["end_reason"])
    return tuple(
        Track(
            *(number, str(goal), int(start), bool(success), str(reason)),
            tuple(pose.position for pose in courses[number].poses),
        )
        for number, goal, start, success, reason in zip(numbers, *columns, strict=True)
        if number in courses and courses[number].poses
    )
