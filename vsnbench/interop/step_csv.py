"""Exports the steps of episodes as one CSV file."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from vsnbench.files.atomic import atomic_file
from vsnbench.interop.episodes import ExportedEpisode
from vsnbench.values.step import StepRecord

COLUMNS = (
    *("episode", "model", "robot", "environment", "site", "goal", "start", "repetition", "end_reason", "success"),
    *("counts", "step", "raw_action", "action", "blocked", "refusal", "failure", "recorded_at", "stamp_s"),
    *("odometry_x_m", "odometry_y_m", "odometry_heading_rad", "world_x_m", "world_y_m", "world_heading_rad"),
)


def write_steps(
    episodes: Sequence[ExportedEpisode],
    steps_of: Callable[[ExportedEpisode], Iterable[StepRecord]],
    path: Path,
) -> int:
    """Write the steps of the episodes and return their number; unknown numbers are empty.

    Raises:
        RecordError: the file cannot be written.
    """
    written = 0
    with atomic_file(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for episode in episodes:
            about = (
                *(episode.id, episode.model, episode.robot, "simulated" if episode.simulated else "real"),
                *(episode.site, episode.goal, episode.start, episode.repetition, episode.end_reason),
                *("" if episode.success is None else episode.success, episode.counts),
            )
            for step in steps_of(episode):
                poses = [
                    value
                    for pose in (step.after, step.world.pose if step.world else None)
                    for value in ((pose.x_m, pose.y_m, pose.heading_rad) if pose else ("", "", ""))
                ]
                recorded_at = step.recorded_at.isoformat() if step.recorded_at else ""
                failure = step.result.failure if step.result else ""
                action = (step.number, step.raw_action, step.action, step.blocked, step.refusal, failure)
                writer.writerow((*about, *action, recorded_at, "" if step.stamp_s is None else step.stamp_s, *poses))
                written += 1
    return written
