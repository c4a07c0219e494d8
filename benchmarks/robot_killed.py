"""Kills the run, or the node that moves the robot, with SIGKILL in the midst of a movement: does the base stop?

    python benchmarks/robot_killed.py --kills 20
    .venv-ros2/bin/python benchmarks/robot_killed.py --ros ros2

The robot, its motion server and the listener are those of `stop_from_page.py`; `vsnbench run --unattended` drives. At a
random moment of a movement either the run or `robots serve` gets SIGKILL. Printed are the times until the base is at
rest for good, by its odometry, and afterwards whether a trial has two results. A run that was killed starts again and
resumes. Exits with 1 if a base moved later than 2 s after a kill.
"""

import argparse
import os
import random
import signal
import sqlite3
import statistics
import sys
import time
from collections import defaultdict
from contextlib import ExitStack, closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.stop_from_page import AT_REST, PROFILES, SimulatedRobot, first_after
from tests.web.blind_study import wait_until

LIMIT_S = 2.0
"""A run that dies leaves the motion server to finish a movement of 0.25 m, some 1 s."""
WATCHED_S = 3.0
TWICE = (
    "SELECT count(*) FROM (SELECT trial_id FROM episode WHERE state IN ('awaiting', 'judged') GROUP BY trial_id HAVING "
    "count(*) > 1)"
)


def time_to_rest(robot: SimulatedRobot, kills_run: bool, chance: random.Random) -> float:
    """Start a run, kill it or the motion server while the base moves, and return the time to rest."""
    run = robot.run("--unattended", "--repetitions", 200)
    wait_until(lambda: robot.listener.speed > 5 * AT_REST or run.poll() is not None, "the base moves", 180)
    assert run.poll() is None, robot.log.read_text()[-1500:]
    time.sleep(chance.uniform(0.0, 3.0))
    wait_until(lambda: robot.listener.speed > 5 * AT_REST, "the base moves", 60)
    (run if kills_run else robot.motion_server).send_signal(signal.SIGKILL)
    killed_s = time.time()
    time.sleep(WATCHED_S)
    rest_s = first_after(robot.listener.odometry, killed_s) - killed_s
    if not kills_run:
        run.send_signal(signal.SIGKILL)
        robot.motion_server.wait()
        robot.motion_server = robot.vsnbench("robots", "serve", robot.profile)
    run.wait()
    return rest_s


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--kills", type=int, default=20)
    options.add_argument("--ros", choices=PROFILES, default="ros1")
    options.add_argument("--seed", type=int, default=1)
    asked = options.parse_args()
    chance, times = random.Random(asked.seed), defaultdict(list)
    with ExitStack() as stack:
        robot = SimulatedRobot(stack, asked.ros, chance)
        for number in range(asked.kills):
            killed = "run" if number % 2 == 0 else "motion server"
            times[killed].append(time_to_rest(robot, killed == "run", chance))
            print(
                f"{number + 1}: {killed} killed, at rest after {times[killed][-1]:.2f} s", file=sys.stderr, flush=True
            )
        with closing(sqlite3.connect(robot.directory / "results" / "vsnbench.db")) as database:
            twice = database.execute(TWICE).fetchone()[0]
    print("| killed | kills | at rest: median | worst | load |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for killed, own in times.items():
        print(
            f"| {asked.ros}: {killed} | {len(own)} | {statistics.median(own):.2f} s | {max(own):.2f} s | "
            f"{os.getloadavg()[1]:.0f} |"
        )
    print(f"{twice} trials with two results")
    return 1 if twice or max(map(max, times.values())) > LIMIT_S else 0


if __name__ == "__main__":
    sys.exit(main())
