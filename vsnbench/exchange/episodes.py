"""Reads episodes of the record for what is written in other formats, and writes the simplest, a trajectory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Engine
from sqlalchemy.orm import Session

from vsnbench.database.blinding import CODE, MODEL_NAME
from vsnbench.database.engine import record_errors
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.read_model import COUNTS, DISTANCE_M, END_REASON, SUCCESS, episodes_of_campaigns
from vsnbench.database.tables import Campaign, Episode, Model, Robot, Site, Trial
from vsnbench.errors import UsageError
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.step_record import StepRecord
from vsnbench.whole_files import whole_file

_NO_EPISODE_LASTS_S = 1e8
"""Larger stamps count from 1970."""


@dataclass(frozen=True, slots=True)
class ExportedEpisode:
    """An episode as other tools know one."""

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
    """None where it is void or awaits its verdict."""
    counts: bool
    """It is its trial's one valid result."""
    actions: int
    started_at: datetime
    distance_to_goal_m: float | None
    path_length_m: float | None
    geodesic_start_m: float | None
    geodesic_end_m: float | None
    start_pose: Pose | None
    images_directory: str
    condition: Mapping[str, Any]
    """What was tested: model with weights and settings, robot, site, protocol, conditions; only like is pooled."""
    camera: Camera | None = None
    """None where the robot's profile is not known."""

    def taken_s(self, step: StepRecord) -> float:
        """Return when a step's images were taken, seconds since 1970, by the robot's clock.

        A simulated robot's clock starts with its episode; a step of unknown time counts as taken when it was recorded.
        """
        if step.stamp_s is None:
            return (step.recorded_at or self.started_at).timestamp()
        return step.stamp_s if step.stamp_s > _NO_EPISODE_LASTS_S else self.started_at.timestamp() + step.stamp_s

    def moved_s(self, step: StepRecord) -> float:
        """Return when a step's motion had ended, on the same clock."""
        lasted_s = step.result.duration_s if step.result else 0.0
        return self.taken_s(step) + (lasted_s if math.isfinite(lasted_s) else 0.0)


def read_episodes(engine: Engine, numbers: Sequence[int] = (), models: Sequence[str] = ()) -> list[ExportedEpisode]:
    """Read ended episodes, all of them or those asked for, in the order of their numbers.

    Raises:
        UsageError: one that was asked for is not there, or still runs.
        RecordError: the database cannot be used.
    """
    query = (
        episodes_of_campaigns(
            *(Episode, Trial, Campaign, Model, Robot, Site),
            *(END_REASON, SUCCESS, DISTANCE_M, COUNTS & (Episode.state == EpisodeState.JUDGED.value), CODE),
        )
        .where(Episode.end_reason.is_not(None))
        .order_by(Episode.id)
    )
    if numbers:
        query = query.where(Episode.id.in_(numbers))
    if models:
        query = query.where(MODEL_NAME.in_(models))
    with record_errors(engine), Session(engine) as session:
        found = [_exported(*row) for row in session.execute(query)]
    there = {episode.id for episode in found}
    if missing := [str(number) for number in numbers if number not in there]:
        raise UsageError(f"no ended episode {', '.join(missing)}", advice="`vsnbench episodes list` shows them")
    if not found:
        raise UsageError("there is no ended episode to export", advice="`vsnbench episodes list` shows what there is")
    return found


def _exported(
    episode: Episode,
    trial: Trial,
    campaign: Campaign,
    model: Model,
    robot: Robot,
    site: Site,
    end_reason: str,
    success: bool | None,
    distance_m: float | None,
    counts: bool,
    code: str | None,
) -> ExportedEpisode:
    return ExportedEpisode(
        id=episode.id,
        model=code or model.name,
        robot=robot.name,
        simulated=robot.simulated,
        site=site.name,
        goal=trial.goal,
        start=trial.start,
        repetition=trial.repetition,
        end_reason=end_reason,
        success=success,
        counts=bool(counts),
        actions=episode.actions,
        started_at=episode.started_at,
        distance_to_goal_m=distance_m,
        path_length_m=episode.path_length_m,
        geodesic_start_m=episode.geodesic_start_m,
        geodesic_end_m=episode.geodesic_end_m,
        start_pose=_pose(episode.start_x_m, episode.start_y_m, episode.start_heading_rad),
        images_directory=episode.images_directory,
        camera=_camera(robot.profile),
        condition={
            "model": code or model.name,
            "weights": "" if code else model.weights_label,
            "weights_sha256": "" if code else model.weights_sha256,
            "settings": {} if code else model.settings,
            "robot": robot.name,
            "robot_sha256": robot.sha256,
            "environment": "simulated" if robot.simulated else "real",
            "site": site.name,
            "site_sha256": site.sha256,
            "protocol": campaign.protocol,
            "conditions": campaign.conditions,
        },
    )


def _pose(x_m: float | None, y_m: float | None, heading_rad: float | None) -> Pose | None:
    return None if x_m is None or y_m is None or heading_rad is None else Pose(x_m, y_m, heading_rad)


def _camera(profile: Mapping[str, Any]) -> Camera | None:
    try:
        return Camera.model_validate(profile.get("camera"))
    except ValidationError:
        return None  # an imported robot, of which no camera is known


def write_tum(episode: ExportedEpisode, steps: Iterable[StepRecord], path: Path) -> int:
    """Write where the robot was after each action, in the TUM format, and return how many poses that is.

    `timestamp tx ty tz qx qy qz qw`, one pose a line, as evo and others read it.

    A pose is as old as the end of its motion, by the robot's clock. Poses are in the site's frame where they are known,
    else odometry since the start of the episode; never a mixture.

    Raises:
        RecordError: the file cannot be written.
    """
    taken = list(steps)
    surveyed = any(step.world for step in taken)
    poses = [
        (episode.moved_s(step), (step.world.pose if step.world else None) if surveyed else step.after) for step in taken
    ]
    frame = "site" if surveyed else "start of the episode"
    with whole_file(path) as part, part.open("w", encoding="utf-8") as file:
        file.write(f"# episode {episode.id}, frame: {frame}; timestamp tx ty tz qx qy qz qw\n")
        written = 0
        for time_s, pose in poses:
            if pose is None:
                continue
            qz, qw = math.sin(pose.heading_rad / 2), math.cos(pose.heading_rad / 2)
            file.write(f"{time_s:.6f} {pose.x_m:.6f} {pose.y_m:.6f} 0 0 0 {qz:.9f} {qw:.9f}\n")
            written += 1
    return written
