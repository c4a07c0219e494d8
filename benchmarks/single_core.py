"""Measures actions per second on one core, compared with an earlier commit.

Two processes, one per commit, take turns and drive the same random actions without recording: observe at 640x480 with
RGB, depth and labels, guard, execute. Prints the actions per second of both, the ratio of their medians, and whether
their images and motions are identical. With `--camera`, this tree renders only RGB at that size.

    python benchmarks/single_core.py [--base d729591] [--rounds 5] [--camera 256x256]
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[1]
DRIVER = """
import hashlib, json, sys, time
from vsnbench.values.action import Action
from vsnbench.values.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import load_site
from vsnbench.robots.registry import open_robot
from vsnbench.runner.episode.depth_guard import look_ahead
import random
name, actions, lean = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "lean"
site, parameters = load_site("apartment"), ProtocolParameters()
only = {"read": frozenset({Sensor.RGB, Sensor.ODOMETRY})} if lean else {}
robot = open_robot(name, site, parameters, **only)
CHOICES = (Action.MOVE_FORWARD, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)

def drive(count, digest):
    rng, done, start = random.Random(7), 0, 0
    while done < count:
        robot.begin(site.starts[start % len(site.starts)], start)
        start += 1
        for _ in range(20):
            seen = robot.observe()
            action = rng.choice(CHOICES)
            guard = look_ahead(seen, robot.profile.base, parameters.depth_guard)
            result = None if action is Action.MOVE_FORWARD and guard.blocked else robot.execute(action)
            done += 1
            if digest is not None:
                digest.update(seen.rgb.data); digest.update(seen.depth_m.data); digest.update(repr(result).encode())
            if done >= count or result is not None and result.collision:
                break

digest = hashlib.sha256()
drive(40, digest)
print(digest.hexdigest(), flush=True)
for _ in sys.stdin:
    began = time.perf_counter()
    drive(actions, None)
    print(json.dumps(actions / (time.perf_counter() - began)), flush=True)
"""


class Driver:
    """A process that drives with the code of one working tree."""

    def __init__(self, tree: Path, robot: str, actions: int, *, lean: bool) -> None:
        environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, robot, str(actions), "lean" if lean else "whole"],
            cwd=tree,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.digest = self._answer()

    def rate(self) -> float:
        """Drive one round and return its actions per second."""
        assert self._process.stdin is not None
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        return float(json.loads(self._answer()))

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a driver ended early")
        return line.strip()


@contextmanager
def earlier_tree(commit: str, tree: Path) -> Iterator[Path]:
    """Check out a commit into a temporary working tree."""
    subprocess.run(["git", "-C", ROOT, "worktree", "add", "--detach", "-q", tree, commit], check=True)
    try:
        yield tree
    finally:
        subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)


def main() -> None:
    """Run the rounds and print the rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="d729591", help="commit to compare with")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--actions", type=int, default=100, help="actions per round")
    parser.add_argument("--camera", default="", help="WIDTHxHEIGHT of the only image that this tree renders")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory, earlier_tree(arguments.base, Path(directory) / "base") as tree:
        lean = bool(arguments.camera)
        robot = f"simulated:turtlebot2@{arguments.camera}" if lean else "simulated"
        base = Driver(tree, "simulated", arguments.actions, lean=False)
        here = Driver(ROOT, robot, arguments.actions, lean=lean)
        rates = [(base.rate(), here.rate()) for _ in range(arguments.rounds)]
        base.close()
        here.close()
    before, after = (statistics.median(column) for column in zip(*rates, strict=True))
    ratios = [new / old for old, new in rates]
    print(
        f"{arguments.base}: {before:.1f} actions/s; this tree{' at ' + arguments.camera if lean else ''}: {after:.1f}"
    )
    print(f"ratio of medians {after / before:.2f}; of {len(ratios)} rounds {min(ratios):.2f} to {max(ratios):.2f}")
    if not lean:
        print("same pixels and motions" if base.digest == here.digest else "DIFFERENT pixels or motions")


if __name__ == "__main__":
    main()
