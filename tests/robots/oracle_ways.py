"""Trials of a stack that knows the flat: it drives the ways of the oracle in simulation over ROS."""

import json
import sqlite3
from pathlib import Path

GOALS, STARTS = ("chair", "bed"), (1, 2, 3, 4, 5)
OF_TRIALS = ("--goal", ",".join(GOALS), "--starts", "1-5")
PLANNED = ("--robot", "simulated", "--model", "oracle", *OF_TRIALS)
"""Words of the `run` that plans the ways."""


def write_ways(results: Path, to: Path) -> None:
    """Write poses of each trial of the oracle, in the frame of the site, by goal."""
    with sqlite3.connect(results / "vsnbench.db") as connection:
        found = connection.execute(
            "select goal, episode.id, start_x_m, start_y_m, start_heading_rad from episode join trial on "
            "trial.id = trial_id order by episode.id"
        ).fetchall()
        assert len(found) == len(GOALS) * len(STARTS)
        ways: dict[str, list[list[list[float]]]] = {goal: [] for goal in GOALS}
        for goal, episode, *start in found:
            poses = connection.execute(
                "select world_x_m, world_y_m, world_heading_rad from step where episode_id = ? order by number",
                (episode,),
            ).fetchall()
            ways[goal].append([start, *map(list, poses)])
    to.write_text(json.dumps(ways))


def check_ten_successes(results: Path, source: str) -> None:
    """Check that all trials have succeeded, with STOP from a source; a void trial may have been run again."""
    with sqlite3.connect(results / "vsnbench.db") as connection:
        ends = connection.execute(
            "select success, end_reason, count(*) from verdict where success is not null group by 1, 2"
        )
        assert ends.fetchall() == [(1, "stop", 10)]
        stops = connection.execute("select raw_action, count(*) from step where action = 'STOP' group by 1")
        assert stops.fetchall() == [(source, 10)]
