"""Measures the speed of two workers relative to one, over complete campaigns.

python benchmarks/worker_scaling.py                      105 trials of the oracle and 90 of pirlnav: 12 minutes
python benchmarks/worker_scaling.py --model oracle       the oracle alone: 4 minutes
python benchmarks/worker_scaling.py --keep all           with Rerun files; `none`: without images; default: as usual
python benchmarks/worker_scaling.py --goal chair         a sixth of that, for a first look

The ratio of wall times includes start-up. The script compares both campaigns step by step, and fails unless every
action, pose and image is the same.

It also prints the processor time of each campaign. Two workers that keep two cores busy all the time need at least half
of it, so the wall time of one worker divided by that half is an upper limit for the ratio.
"""

import argparse
import hashlib
import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

STORY = """
    SELECT t.goal, t.start, t.repetition, e.seed, e.end_reason, e.distance_to_goal_m, s.number, s.action, s.blocked,
           s.observed_x_m, s.observed_y_m, s.observed_heading_rad, s.world_x_m, s.world_y_m, s.world_heading_rad,
           s.rgb_digest, s.depth_digest
    FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
    WHERE e.state = 'judged' ORDER BY t.goal, t.start, t.repetition, s.number
"""


def processor_s() -> float:
    """Return the processor time of all ended child processes and their children."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def campaign(model: str, goal: str, kept: str, where: list[str], results: Path) -> tuple[float, float, int, str]:
    """Run a campaign; return its wall and processor seconds, its actions, and a hash of its steps."""
    words = ["run", "--model", model, "--goal", goal, *where, "--results", str(results)]
    words += ["--keep", kept] if kept else []
    began, spent_s = time.perf_counter(), processor_s()
    subprocess.run([sys.executable, "-m", "vsnbench.cli.main", *words], check=True, stderr=subprocess.DEVNULL)
    taken_s, spent_s = time.perf_counter() - began, processor_s() - spent_s
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        steps = connection.execute(STORY).fetchall()
    return taken_s, spent_s, len(steps), hashlib.sha256(repr(steps).encode()).hexdigest()


def main() -> None:
    """Run the campaigns and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--model", action="append", help="model; default: oracle and pirlnav")
    parser.add_argument("--goal", default="all")
    parser.add_argument("--keep", default="", choices=["all", "images", "none"], help="episode files to keep")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--cluster", default="", help="ray://HEAD:PORT of a Ray cluster to compare with")
    asked = parser.parse_args()
    print(f"load before: {os.getloadavg()[0]:.2f} on {len(os.sched_getaffinity(0))} cores")
    for model in asked.model or ["oracle", "pirlnav"]:
        ways = [["--workers", "1"], ["--workers", str(asked.workers)]]
        if asked.cluster:
            ways.append(["--workers", asked.cluster])
        seen = set()
        alone_s = 0.0
        for way in ways:
            with tempfile.TemporaryDirectory(prefix="vsnbench-scaling-") as directory:
                taken_s, spent_s, actions, story = campaign(model, asked.goal, asked.keep, way, Path(directory))
            alone_s = alone_s or taken_s
            seen.add(story)
            print(
                f"{model:8} {' '.join(way):32} {taken_s:6.1f} s, {spent_s:6.1f} s processor time  "
                f"{actions / taken_s:5.1f} actions/s  {alone_s / taken_s:.2f} times  {story[:12]}",
                flush=True,
            )
        if len(seen) > 1:
            sys.exit(f"{model}: the campaigns differ")


if __name__ == "__main__":
    main()
