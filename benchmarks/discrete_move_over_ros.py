"""How precisely discrete_move moves over a real ROS network, by odometry rate and dead time of the base.

For each setting: a master, `vsnbench ros1 simulate` in an empty hall, `vsnbench ros1 discrete-move`, random movements
through the service; what the odometry and the simulator's truth say afterwards becomes a line of the table.

    python benchmarks/discrete_move_over_ros.py --actions 300 --jobs 2 > docs/discrete-move-accuracy.md
"""

import argparse
import itertools
import json
import math
import os
import random
import re
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

SETTINGS = [(rate_hz, lag_s, "") for rate_hz in (10.0, 20.0, 50.0) for lag_s in (0.0, 0.1)] + [(50.0, 0.1, "noise")]
"""Odometry's rate, dead time of the base, and whether odometry has noise."""
HALL = """
name: hall
rooms: [{name: hall, polygon: [[-25, -25], [25, -25], [25, 25], [-25, 25]]}]
walls: [{start: [-25, -25], end: [25, -25]}]
starts: [{number: 1, position: [0, 0], heading_deg: 17}]
"""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--actions", type=int, default=300)
    options.add_argument("--jobs", type=int, default=1, help="settings at the same time")
    options.add_argument("--worker", help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.worker:
        rate_hz, lag_s, noise = chosen.worker.split(":")
        sys.stdout.write(json.dumps(measure(float(rate_hz), float(lag_s), noise, chosen.actions)) + "\n")
        return

    def run(setting: tuple[float, float, str]) -> dict:
        words = [sys.executable, __file__, "--actions", str(chosen.actions), "--worker", "{}:{}:{}".format(*setting)]
        with tempfile.TemporaryDirectory() as directory:
            environment = os.environ | {
                "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
                "ROS_IP": "127.0.0.1",
                "ROS_HOME": directory,
                "ROS_LOG_DIR": directory,
            }
            done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        sys.stderr.write(done.stderr)
        return json.loads(done.stdout.splitlines()[-1])

    with ThreadPoolExecutor(chosen.jobs) as pool:
        rows = list(pool.map(run, SETTINGS))
    sys.stdout.write(report(rows, chosen.actions))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def measure(rate_hz: float, lag_s: float, noise: str, actions: int) -> dict:
    """Run one setting in this process and its children; return one row."""
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (directory / "hall.yaml").write_text(HALL)
        port = os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]
        vsnbench = [sys.executable, "-m", "vsnbench.cli.main", "ros"]

        def start(*words: str) -> None:
            process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        rosmaster = shutil.which("rosmaster", path=f"{sys.prefix}/bin:/usr/bin") or "rosmaster"
        start(sys.executable, rosmaster, "--core", "-p", port)
        from vsnbench.robots.profiles import embedded_profiles
        from vsnbench.ros1.master import Master

        Master.from_environment().wait(20)
        rate, lag = f"--odometry-rate={rate_hz}", f"--command-lag={lag_s}"
        profile = directory / "turtlebot2.yaml"
        profile.write_text(small_camera(embedded_profiles()["turtlebot2"].read_text()))
        noisy = ["--noise"] if noise else []
        robot = f"--robot={profile}"
        start(*vsnbench, "simulate", "--site", str(directory / "hall.yaml"), robot, rate, lag, *noisy)
        start(*vsnbench, "discrete-move", robot)
        return drive(profile, rate_hz, lag_s, noise, actions)


def small_camera(profile: str) -> str:
    """Return a profile whose camera costs next to nothing: pictures are not what is measured here."""
    profile = re.sub(r"width: \d+", "width: 64", re.sub(r"height: \d+", "height: 48", profile))
    return profile.replace("kind: ros1", "kind: ros1\n  camera_rate_hz: 2")


def drive(path: Path, rate_hz: float, lag_s: float, noise: str, actions: int) -> dict:
    """Ask for random movements and compare what was asked with odometry and truth."""
    from vsnbench.motion.law import ideal_duration_s
    from vsnbench.motion.settings import MotionSettings
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros1.robot_link import RobotLink
    from vsnbench.sensing.discrete_mover import MOVEMENTS

    profile = load_profile(path)
    link = RobotLink(profile)
    give_up_s = time.monotonic() + 60
    while not (link.can_be_placed and link.names.discrete_move in link.master.state().services):
        if time.monotonic() > give_up_s:
            raise SystemExit("the stack did not come up")
        time.sleep(0.2)
    link.join_simulation()
    settings = MotionSettings.for_robot(profile)
    choice = random.Random(f"{rate_hz} {lag_s} {noise}")

    def here() -> tuple:
        asked_s = time.monotonic()
        link.wait_for(lambda now: now.latest is not None and now.latest.arrival_s > asked_s, 5.0)
        link.wait_for(lambda now: now.truth is not None and now.truth.arrival_s > asked_s, 5.0)
        now = link.snapshot()
        return now.latest.pose, now.truth.payload

    errors_m, errors_deg, relative_deg, true_m, ratios, refused, dishonest = [], [], [], [], [], 0, 0
    if not link.wait_for(lambda now: steady(now.readings, rate_hz), 120.0):
        raise SystemExit("the odometry does not come at its rate")
    reasons: list[str] = []
    before, true_before = here()
    held_rad = before.heading_rad
    for _ in range(actions):
        word = choice.choices(["Forward", "Backward", "Left", "Right"], [4, 1, 3, 3])[0]
        action = MOVEMENTS[word]
        began_s = time.monotonic()
        answered = link.move(word, 30 if action.turns else 0, 60)
        ratios.append((time.monotonic() - began_s) / ideal_duration_s(action, settings))
        after, true_after = here()
        if not answered:
            refused += 1
            link.wait_for(lambda now: now.outcome is not None, 0.5)
            said = link.snapshot().outcome
            reasons.append(re.sub(r"[0-9.]+", "N", said.reason) if said else "no reason came")
            held_rad = after.heading_rad
        elif action.turns:
            asked_rad = math.radians(30) * (1 if word == "Left" else -1)
            held_rad += asked_rad
            relative_deg.append(abs(math.degrees(after.heading_rad - before.heading_rad - asked_rad)))
            errors_deg.append(abs(math.degrees(after.heading_rad - held_rad)))
            dishonest += errors_deg[-1] >= 0.1
        else:
            errors_m.append(abs(before.distance_to(after) - 0.25))
            true_m.append(abs(true_before.distance_to(true_after) - 0.25))
            dishonest += errors_m[-1] >= 0.005
        before, true_before = after, true_after
    link.close()
    return {
        "rate_hz": rate_hz,
        "lag_s": lag_s,
        "noise": noise,
        "moves": len(errors_m),
        "turns": len(errors_deg),
        "refused": refused,
        "reasons": reasons,
        "dishonest": dishonest,
        "worst_mm": max(errors_m, default=math.nan) * 1000,
        "worst_true_mm": max(true_m, default=math.nan) * 1000,
        "worst_deg": max(errors_deg, default=math.nan),
        "worst_relative_deg": max(relative_deg, default=math.nan),
        "drift_deg": math.degrees(before.heading_rad - held_rad),
        "median_ratio": statistics.median(ratios),
        "p90_ratio": statistics.quantiles(ratios, n=10)[-1] if len(ratios) > 1 else math.nan,
    }


def steady(readings: tuple, rate_hz: float) -> bool:
    """Return whether a second of odometry came without a gap: the simulator has compiled what it needs."""
    arrivals = [reading.arrival_s for reading in readings[-int(rate_hz) - 1 :]]
    gaps = [later - earlier for earlier, later in itertools.pairwise(arrivals)]
    return len(gaps) >= rate_hz and max(gaps) < 3 / rate_hz


COLUMNS = [
    *("odometry", "lag", "True", "False", "dishonest", "worst move", "true", "worst turn", "call to call", "drift"),
    *("time, median", "p90"),
]


def report(rows: list[dict], actions: int) -> str:
    """Return the rows as Markdown."""
    lines = [
        "# Precision of discrete_move over ROS",
        "",
        f"{actions} random movements a setting (25 cm forward or backward, 30° left or right) through the ROS service,",
        "against `vsnbench ros1 simulate` in an empty hall, everything in real time. Errors are the odometry's, turns",
        'against the absolute heading held since the start, which is what is promised; "call to call" is the',
        'difference of two headings, the end of the move between them included. "true" is the simulator\'s own pose,',
        "which wheel slip and noise part from the odometry. The tolerances are 5 mm and 0.1°; True outside of them is",
        "dishonest. Time is the whole service call over the ideal profile's duration.",
        "Written by `benchmarks/discrete_move_over_ros.py`.",
        "",
        f"| {' | '.join(COLUMNS)} |",
        f"|{' --- |' * len(COLUMNS)}",
    ]
    lines += [
        f"| {r['rate_hz']:g} Hz{', noise' if r['noise'] else ''} | {r['lag_s']:g} s "
        f"| {r['moves'] + r['turns']} | {r['refused']} | {r['dishonest']} "
        f"| {r['worst_mm']:.2f} mm | {r['worst_true_mm']:.2f} mm | {r['worst_deg']:.3f}° "
        f"| {r['worst_relative_deg']:.3f}° | {r['drift_deg']:+.3f}° "
        f"| {r['median_ratio']:.2f}x | {r['p90_ratio']:.2f}x |"
        for r in rows
    ]
    reasons = Counter(reason for row in rows for reason in row["reasons"])
    lines += ["", *(f"False {count} times: {reason}" for reason, count in reasons.most_common())]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
