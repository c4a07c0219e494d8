"""Reads recorded episodes for export, and writes trajectories in the TUM format."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Engine
from sqlalchemy.orm import Session

from vsnbench.errors import UsageError
from vsnbench.files.atomic import atomic_file
from vsnbench.results.files.images import StampedPose, tum_line
from vsnbench.results.goals import goal_text
from vsnbench.results.reading.blinding import CODE, MODEL_NAME
from vsnbench.results.reading.read_model import COUNTS, END_REASON, SUCCESS, episodes_of_campaigns
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.row_encoding import pose_of_columns
from vsnbench.results.schema.tables import Campaign, Episode, Goal, Model, Robot, Site, Trial
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.values.camera import Camera
from vsnbench.values.goal import GoalKind
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord

_NO_EPISODE_LASTS_S = 1e8
"""Larger time stamps count from 1970."""


@dataclass(frozen=True, slots=True)
class ExportedEpisode:
    """An episode with the data that other tools need."""

    id: int
    model: str
    robot: str
    simulated: bool
    site: str
    goal: str
    start: int
    repetition: int
    end_reason: str
    success: bool | None
    """None if the episode is void or awaits a verdict."""
    counts: bool
    """The episode counts for its trial."""
    started_at: datetime
    start_pose: Pose | None
    images_directory: str
    camera: Camera | None = None
    """None if the robot's profile is unknown."""
    goal_kind: GoalKind = GoalKind.CATEGORY
    goal_text: str = ""
    """Words of a text goal, an instruction or a category of the site file, else empty."""

    def taken_s(self, step: StepRecord) -> float:
        """Return the time of a step's images on the robot's clock, seconds since 1970.

        A simulated robot's clock starts with its episode; for an unknown time the time of recording is used.
        """
        if step.stamp_s is None:
            return (step.recorded_at or self.started_at).timestamp()
        return step.stamp_s if step.stamp_s > _NO_EPISODE_LASTS_S else self.started_at.timestamp() + step.stamp_s

    def moved_s(self, step: StepRecord) -> float:
        """Return the end of a step's motion on the same clock."""
        lasted_s = step.result.duration_s if step.result else 0.0
        return self.taken_s(step) + (lasted_s if math.isfinite(lasted_s) else 0.0)


def read_episodes(
    engine: Engine, numbers: Sequence[int] = (), models: Sequence[str] = (), goals: Sequence[str] = ()
) -> list[ExportedEpisode]:
    """Read ended episodes, all or the selected ones, by number.

    Raises:
        UsageError: a selected episode does not exist or has not ended.
        RecordError: the database cannot be used.
    """
    query = (
        episodes_of_campaigns(
            *(Episode, Trial, Campaign, Model, Robot, Site, SUCCESS.label("success")),
            *(END_REASON.label("end_reason"), CODE.label("code")),
            (COUNTS & (Episode.state == EpisodeState.JUDGED.value)).label("counts"),
            *(Goal.kind.label("goal_kind"), Goal.content.label("goal_content")),
        )
        .outerjoin(Goal, Goal.id == Trial.goal_id)
        .where(Episode.end_reason.is_not(None))
        .order_by(Episode.id)
    )
    if numbers:
        query = query.where(Episode.id.in_(numbers))
    if models:
        query = query.where(MODEL_NAME.in_(models))
    if goals:
        query = query.where(Trial.goal.in_(goals))
    with record_errors(engine), Session(engine) as session:
        found = [_exported(row) for row in session.execute(query)]
    there = {episode.id for episode in found}
    if missing := [str(number) for number in numbers if number not in there]:
        raise UsageError(f"no ended episode {', '.join(missing)}", advice="`vsnbench episodes list` lists the episodes")
    if not found:
        raise UsageError("no ended episodes to export", advice="`vsnbench episodes list` lists the episodes")
    return found


def _exported(row: Any) -> ExportedEpisode:
    episode, trial, model, robot, site, code = row.Episode, row.Trial, row.Model, row.Robot, row.Site, row.code
    return ExportedEpisode(
        id=episode.id,
        model=code or model.name,
        robot=robot.name,
        simulated=robot.simulated,
        site=site.name,
        goal=trial.goal,
        start=trial.start,
        repetition=trial.repetition,
        end_reason=row.end_reason,
        success=row.success,
        counts=bool(row.counts),
        started_at=episode.started_at,
        start_pose=pose_of_columns(episode.start_x_m, episode.start_y_m, episode.start_heading_rad),
        images_directory=episode.images_directory,
        camera=_camera(robot.profile),
        goal_kind=GoalKind(row.goal_kind or GoalKind.CATEGORY),
        goal_text=goal_text(row.goal_content or {}),
    )


def _camera(profile: Mapping[str, Any]) -> Camera | None:
    try:
        return Camera.model_validate(profile.get("camera"))
    except ValidationError:
        return None  # an imported robot without a known camera


def write_tum(episode: ExportedEpisode, steps: Iterable[StepRecord], path: Path) -> int:
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
        (episode.moved_s(step), (step.world.pose if step.world else None) if surveyed else step.after) for step in taken
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
