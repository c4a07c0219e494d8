"""Reads recorded episodes for export, and writes trajectories in the TUM format."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Engine

from vsnbench.errors import UsageError
from vsnbench.files.atomic import atomic_file
from vsnbench.results.files.film import StampedPose
from vsnbench.results.files.images import tum_line
from vsnbench.results.model import Episode
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.step import StepRecord, lasted_s

_NO_EPISODE_LASTS_S = 1e8
"""Larger time stamps count from 1970."""


def taken_s(episode: Episode, step: StepRecord) -> float:
    """Return the time of a step's images on the robot's clock, seconds since 1970.

    A simulated robot's clock starts with its episode; for an unknown time the time of recording is used.
    """
    if step.stamp_s is None:
        return (step.recorded_at or episode.started_at).timestamp()
    return step.stamp_s if step.stamp_s > _NO_EPISODE_LASTS_S else episode.started_at.timestamp() + step.stamp_s


def moved_s(episode: Episode, step: StepRecord) -> float:
    """Return the end of a step's motion on the same clock."""
    way_s = lasted_s(0.0 if step.stamp_s is None else step.stamp_s, step.result, step.answer)
    return taken_s(episode, step) + (way_s if math.isfinite(way_s) else 0.0)


def read_episodes(
    engine: Engine, numbers: Sequence[int] = (), models: Sequence[str] = (), goals: Sequence[str] = ()
) -> tuple[Episode, ...]:
    """Read ended episodes, all or the selected ones, by number.

    Raises:
        UsageError: a selected episode does not exist or has not ended.
        RecordError: the database cannot be used.
    """
    which = EpisodeFilter(numbers=tuple(numbers), models=tuple(models), goals=tuple(goals), has_ended=True)
    found = list_episodes(engine, which)
    there = {episode.id for episode in found}
    if missing := [str(number) for number in numbers if number not in there]:
        raise UsageError(f"no ended episode {', '.join(missing)}", advice="`vsnbench episodes list` lists the episodes")
    if not found:
        raise UsageError("no ended episodes to export", advice="`vsnbench episodes list` lists the episodes")
    return found


def cameras_of(profile: Mapping[str, Any]) -> dict[CameraRole, Camera]:
    """Return the cameras of a recorded robot by role; nothing if they are unknown, as in imports."""
    try:
        main, further = Camera.model_validate(profile.get("camera")), profile.get("cameras") or {}
        return {CameraRole.FRONT: main} | {CameraRole(role): Camera.model_validate(further[role]) for role in further}
    except (ValidationError, ValueError, TypeError):
        return {}


def write_tum(episode: Episode, steps: Iterable[StepRecord], path: Path) -> int:
    """Write the pose after each action in the TUM format, and return the number of poses.

    Each line is `timestamp tx ty tz qx qy qz qw`, as evo and other tools read it. The time is the end of the motion on
    the robot's clock. If all poses in the site are known, they are in the site's frame, otherwise all are odometry
    since the start of the episode.

    Raises:
        RecordError: the file cannot be written.
    """
    taken = list(steps)
    surveyed = any(step.world for step in taken)
    poses = [
        (moved_s(episode, step), (step.world.pose if step.world else None) if surveyed else step.after)
        for step in taken
    ]
    frame = "site" if surveyed else "start of the episode"
    with atomic_file(path) as part, part.open("w", encoding="utf-8") as file:
        file.write(f"# episode {episode.id}, frame: {frame}; timestamp tx ty tz qx qy qz qw\n")
        written = 0
        for time_s, pose in poses:
            if pose is None:
                continue
            file.write(tum_line(StampedPose(time_s, pose)))
            written += 1
    return written
