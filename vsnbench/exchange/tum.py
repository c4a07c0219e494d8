"""Trajectories in the TUM format: `timestamp tx ty tz qx qy qz qw`, one pose a line, as evo and others read it."""

import math
from collections.abc import Iterable
from pathlib import Path

from vsnbench.exchange.episodes import ExportedEpisode
from vsnbench.protocol.step_record import StepRecord
from vsnbench.whole_files import whole_file


def write_tum(episode: ExportedEpisode, steps: Iterable[StepRecord], path: Path) -> int:
    """Write where the robot was after each action and return how many poses that is.

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
