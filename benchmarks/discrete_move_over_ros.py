"""Measures the accuracy of movements over ROS, by odometry rate and base latency.

For each setting, `vsnbench robots simulate` simulates a robot in an empty hall, and the script requests random
movements. `vsnbench robots serve` executes them, for ROS 2 next to the base; otherwise the workstation's own control
loop does. For ROS 2, a relay can delay each message by 30 ms in each direction. Each setting gives a table row with
errors in mm and degrees, from the odometry and from the simulator's true pose. `--rows` collects the rows in a file,
and `--report` writes the page from all of them.

    python benchmarks/discrete_move_over_ros.py --actions 300 --jobs 4 --rows rows.jsonl
    .venv-ros2/bin/python benchmarks/discrete_move_over_ros.py --ways ros2 ros2-onboard ros2-wifi --rows rows.jsonl
    python benchmarks/discrete_move_over_ros.py --report --rows rows.jsonl > motion-accuracy.md

With `--standing`, the odometry has white noise of 0.05 degrees and 2 mm, also at rest. Errors then come from the true
pose:

    python benchmarks/discrete_move_over_ros.py --standing --actions 200 --rows standing.jsonl
    .venv-ros2/bin/python benchmarks/discrete_move_over_ros.py --standing --ways ros2 ros2-onboard --actions 200 \
        --rows standing.jsonl
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
from typing import Any

SETTINGS = [(rate_hz, lag_s, "") for rate_hz in (10.0, 20.0, 50.0) for lag_s in (0.0, 0.1)] + [(50.0, 0.1, "noise")]
"""Odometry rate in Hz, latency of the base in seconds, and kind of odometry noise."""
STANDING = [(rate_hz, 0.0, noise) for rate_hz in (20.0, 50.0) for noise in ("", "standing")]
STANDING_DEG, STANDING_MM = 0.05, 2.0
"""Standard deviations of the noise of `--standing`."""
WAYS = {
    "ros1": "ROS 1, by `vsnbench robots serve` (Turtlebot 2)",
    "ros2": "ROS 2, by the workstation's own loop (TurtleBot 4)",
    "ros2-onboard": "ROS 2, by `vsnbench robots serve` next to the base (TurtleBot 4)",
    "ros2-wifi": "ROS 2, by the workstation's own loop, 30 ms each way from the base (TurtleBot 4)",
    "ros2-onboard-wifi": "ROS 2, by `vsnbench robots serve` next to the base, the workstation 30 ms away",
}
NOISES = {"": "", "noise": ", noise", "standing": f", {STANDING_DEG:g}° and {STANDING_MM:g} mm at rest"}
DELAY_S, JITTER_S = 0.03, 0.01
HALL = """
name: hall
rooms: [{name: hall, polygon: [[-25, -25], [25, -25], [25, 25], [-25, 25]]}]
walls: [{start: [-25, -25], end: [25, -25]}]
starts: [{number: 1, position: [0, 0], heading_deg: 17}]
"""
RELAY = Path(__file__).with_name("nodes") / "delaying_relay.py"
Setting = tuple[float, float, str]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--actions", type=int, default=300)
    options.add_argument("--jobs", type=int, default=1, help="number of settings to measure in parallel")
    options.add_argument("--ways", nargs="+", choices=WAYS, default=["ros1"])
    options.add_argument("--settings", type=int, default=len(SETTINGS), help="number of settings, from the last")
    options.add_argument("--rows", type=Path, help="file of results, extended by each run; settings in it are skipped")
    options.add_argument("--standing", action="store_true", help="compare odometry with and without noise at rest")
    options.add_argument("--report", action="store_true", help="only write the page from the results in --rows")
    options.add_argument("--worker", help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.worker:
        way, rate_hz, lag_s, noise = chosen.worker.split(":")
        row = measure(way, (float(rate_hz), float(lag_s), noise), chosen.actions)
        sys.stdout.write(json.dumps(row) + "\n")
        return
    known = chosen.rows and chosen.rows.exists() and chosen.rows.read_text().splitlines()
    rows = [json.loads(line) for line in known or []]
    done = {(row["way"], row["rate_hz"], row["lag_s"], row["noise"]) for row in rows}

    def run(planned: tuple[int, str, Setting]) -> None:
        number, way, setting = planned
        try:
            row = run_apart(way, setting, chosen.actions, number)
        except RuntimeError as error:
            sys.stderr.write(f"{error}\n")
            return
        rows.append(row)
        if chosen.rows:
            with chosen.rows.open("a") as file:
                file.write(json.dumps(row) + "\n")

    if not chosen.report:
        wanted = [
            (way, setting)
            for way in chosen.ways
            for setting in (STANDING if chosen.standing else SETTINGS[-chosen.settings :])
            if (way, *setting) not in done
        ]
        with ThreadPoolExecutor(chosen.jobs) as pool:
            list(pool.map(run, [(number, way, setting) for number, (way, setting) in enumerate(wanted)]))
    sys.stdout.write(report(rows))


def run_apart(way: str, setting: Setting, actions: int, number: int) -> dict[str, Any]:
    """Measure one setting in a separate process and ROS network; return its row."""
    command = [sys.executable, __file__, "--actions", str(actions), "--worker", "{}:{}:{}:{}".format(way, *setting)]
    with tempfile.TemporaryDirectory() as directory:
        environment = os.environ | {
            "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": directory,
            "ROS_LOG_DIR": directory,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(20 + number % 80),
        }
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{command[-1]} failed and is skipped: {done.stderr[-600:]}")
    return {**json.loads(done.stdout.splitlines()[-1]), "load": os.getloadavg()[1]}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def measure(way: str, setting: Setting, actions: int) -> dict[str, Any]:
    """Measure one setting in this process and its children; return its row."""
    from vsnbench.robots.profiles import embedded_profiles, load_profile

    rate_hz, lag_s, noise = setting
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (directory / "hall.yaml").write_text(HALL)

        def start(*words: object) -> None:
            process = subprocess.Popen(list(map(str, words)), stdout=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        ros = way.partition("-")[0]
        profile = directory / "robot.yaml"
        embedded = embedded_profiles()["turtlebot2" if ros == "ros1" else "turtlebot4"]
        profile.write_text(with_small_camera(embedded.read_text()))
        near = str(profile)
        if ros == "ros1":
            rosmaster = shutil.which("rosmaster", path=f"{sys.prefix}/bin:/usr/bin") or "rosmaster"
            start(sys.executable, rosmaster, "--core", "-p", os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1])
            from vsnbench.ros.ros1.master import Master

            Master.from_environment().wait(20)
        else:
            near += "@near"
        vsnbench = [sys.executable, "-m", "vsnbench.cli.main", "robots"]
        dynamics = {"dead_time_s": lag_s, "odometry_rate_hz": rate_hz}
        if noise == "standing":
            dynamics |= {"heading_noise_deg": STANDING_DEG, "position_noise_m": STANDING_MM / 1000}
        base = directory / "base.yaml"
        base.write_text("".join(f"{name}: {value}\n" for name, value in dynamics.items()))
        how = ["--base", base, *(["--noise"] if noise == "noise" else [])]
        start(*vsnbench, "simulate", near, "--site", directory / "hall.yaml", *how)
        if way == "ros1" or "onboard" in way:
            start(*vsnbench, "serve", near)
        reached, server = near, "workstation" if way in ("ros2", "ros2-wifi") else "vsnbench"
        if "wifi" in way:
            start(sys.executable, RELAY, profile, DELAY_S, JITTER_S, server)
            reached = f"{profile}@far"
        moved = drive(load_profile(reached), setting, actions, server)
        return {"way": way, "rate_hz": rate_hz, "lag_s": lag_s, "noise": noise, "actions": actions, **moved}


def with_small_camera(profile: str) -> str:
    """Return the profile with a small, slow camera, because images are not measured."""
    profile = re.sub(r"width: \d+", "width: 64", re.sub(r"height: \d+", "height: 48", profile))
    return re.sub(r"kind: (ros\d)", r"kind: \1\n  camera_rate_hz: 2", profile)


def drive(profile: Any, setting: Setting, actions: int, server: str) -> dict[str, Any]:
    """Request random movements and compare each with the odometry and the true pose."""
    from vsnbench.control.legs import longest_duration_s
    from vsnbench.control.settings import MotionSettings
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.robots.ros.link import connect
    from vsnbench.robots.ros.start import Patience, wait_until_ready
    from vsnbench.values.movement import Action

    link = connect(profile)
    # The link chooses once per session what executes movements, from the nodes that it has discovered by then.
    time.sleep(0 if link.kind == "ros1" else 10)
    wait_until_ready(link, Patience(180))
    assert link.server == server, f"{link.server} executes movements, not {server}"
    truth = Truth(link)
    settings = MotionSettings.for_robot(profile)
    movements = [
        ProtocolParameters().movement_of(action)
        for action in (Action.MOVE_FORWARD, Action.MOVE_BACKWARD, Action.TURN_LEFT, Action.TURN_RIGHT)
    ]
    choice = random.Random("{} {} {}".format(*setting))

    def here() -> tuple:
        asked_s = time.monotonic() + (DELAY_S + 5 * JITTER_S if link.kind == "ros2" else 0)
        link.wait_for(lambda now: now.latest is not None and now.latest.arrival_s > asked_s, 5.0)
        link.wait_for(lambda _: truth.arrival_s > asked_s, 5.0)
        return truth.pose if setting[2] == "standing" else link.snapshot().latest.pose, truth.pose

    errors_m, errors_deg, relative_deg, true_m, ratios, refused, dishonest = [], [], [], [], [], 0, 0
    if not link.wait_for(lambda now: steady(now.readings, setting[0]), 120.0):
        raise SystemExit("the odometry does not arrive at its rate")
    reasons: list[str] = []
    before, true_before = here()
    held_rad = before.heading_rad
    for _ in range(actions):
        movement = choice.choices(movements, [4, 1, 3, 3])[0]
        ideal_s = longest_duration_s(movement, settings) - settings.timeout_s
        began_s = time.monotonic()
        answered = link.drive(movement, 60)
        ratios.append((time.monotonic() - began_s) / ideal_s)
        after, true_after = here()
        if not answered:
            refused += 1
            link.wait_for(lambda now: now.outcome is not None, 0.5)
            failure = link.snapshot().outcome
            # The command that ended the movement may not have reached a base with latency yet.
            link.wait_for(lambda now: now.at_rest(0.5, 0.0005, math.radians(0.01)), 5.0)
            after, true_after = here()
            reasons.append(re.sub(r"[0-9.]+", "N", failure.failure) if failure else "no reason received")
            held_rad = after.heading_rad
        elif movement.turn_rad:
            asked_rad = movement.turn_rad
            held_rad += asked_rad
            turned_rad = after.heading_rad - before.heading_rad
            relative_deg.append(abs(math.degrees(math.remainder(turned_rad - asked_rad, math.tau))))
            errors_deg.append(abs(math.degrees(math.remainder(after.heading_rad - held_rad, math.tau))))
            dishonest += errors_deg[-1] >= 0.1
        else:
            errors_m.append(abs(before.distance_to(after) - 0.25))
            true_m.append(abs(true_before.distance_to(true_after) - 0.25))
            dishonest += errors_m[-1] >= 0.005
        before, true_before = after, true_after
    link.close()
    return {
        "moves": len(errors_m),
        "turns": len(errors_deg),
        "refused": refused,
        "reasons": reasons,
        "dishonest": dishonest,
        "worst_mm": max(errors_m, default=math.nan) * 1000,
        "worst_true_mm": max(true_m, default=math.nan) * 1000,
        "worst_deg": max(errors_deg, default=math.nan),
        "worst_relative_deg": max(relative_deg, default=math.nan),
        "drift_deg": math.degrees(math.remainder(before.heading_rad - held_rad, math.tau)),
        "longest_ratio": max(ratios),
        "median_ratio": statistics.median(ratios),
        "p90_ratio": statistics.quantiles(ratios, n=10)[-1] if len(ratios) > 1 else math.nan,
    }


class Truth:
    """True pose of the simulated robot. Over ROS 2, frequent messages are decoded only on access."""

    def __init__(self, link: Any) -> None:
        self._link = link
        self._newest: tuple[float, bytes] = (-math.inf, b"")
        if link.kind == "ros1":
            link.join_simulation()
            return
        from nav_msgs.msg import Odometry

        from vsnbench.ros.ros2.node import SENSOR_DATA
        from vsnbench.sensing.simulation import GROUND_TRUTH

        topic = link.names.resolve(GROUND_TRUTH.lstrip("/"))
        link.node.rclpy.create_subscription(Odometry, topic, self._keep, SENSOR_DATA, raw=True)

    def _keep(self, data: bytes) -> None:
        self._newest = (time.monotonic(), data)

    @property
    def arrival_s(self) -> float:
        """Arrival time of the newest message, on the monotonic clock."""
        if self._link.kind == "ros1":
            truth = self._link.snapshot().truth
            return truth.arrival_s if truth else -math.inf
        return self._newest[0]

    @property
    def pose(self) -> Any:
        if self._link.kind == "ros1":
            return self._link.snapshot().truth.payload
        from nav_msgs.msg import Odometry
        from rclpy.serialization import deserialize_message

        from vsnbench.ros.common.messages import planar
        from vsnbench.values.pose import Pose

        return Pose(*planar(deserialize_message(self._newest[1], Odometry)))


def steady(readings: tuple, rate_hz: float) -> bool:
    """Return whether odometry arrives without gaps, so the simulator has finished compiling."""
    gaps = [later.arrival_s - earlier.arrival_s for earlier, later in itertools.pairwise(readings)]
    return len(gaps) > 9 and max(gaps) < max(3 / rate_hz, 0.2)


COLUMNS = [
    *("odometry", "lag", "True", "False", "dishonest", "worst move", "true", "worst turn", "call to call", "drift"),
    *("time, median", "p90", "longest"),
]


def report(rows: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    actions = sorted({row["actions"] for row in rows})
    lines = [
        "# Precision of movements over ROS",
        "",
        f"{' or '.join(map(str, actions))} random movements per setting (25 cm forward or backward, 30° left or",
        "right), in `vsnbench robots simulate` in an empty hall, in real time. Errors come from the odometry. The",
        "error of a turn is against the absolute heading held since the start, to which the tolerance applies. `call",
        "to call` is the difference of two successive headings and includes the end of the move between them. `true`",
        "comes from the simulator's pose, from which wheel slip and noise separate the odometry. The tolerances are",
        "5 mm and 0.1°; an answer of True outside them is dishonest. Time is the duration of the whole call, as a",
        "multiple of the ideal profile's duration.",
        "Written by `benchmarks/discrete_move_over_ros.py`.",
    ]
    for way, title in WAYS.items():
        of_way = {(row["rate_hz"], row["lag_s"], row["noise"]): row for row in rows if row["way"] == way}
        if of_way:
            lines += ["", f"## {title}", "", f"| {' | '.join(COLUMNS)} |", f"|{' --- |' * len(COLUMNS)}"]
            lines += [
                table_line(of_way[setting]) for setting in dict.fromkeys([*SETTINGS, *STANDING]) if setting in of_way
            ]
            reasons = Counter(reason for row in of_way.values() for reason in row["reasons"])
            lines += ["", *(f"False {count} times: {reason}" for reason, count in reasons.most_common())]
    return "\n".join(lines).rstrip() + "\n"


def table_line(r: dict[str, Any]) -> str:
    """Return a row as a line of the table."""
    return (
        f"| {r['rate_hz']:g} Hz{NOISES[r['noise']]} | {r['lag_s']:g} s "
        f"| {r['moves'] + r['turns']} | {r['refused']} | {r['dishonest']} "
        f"| {r['worst_mm']:.2f} mm | {r['worst_true_mm']:.2f} mm | {r['worst_deg']:.3f}° "
        f"| {r['worst_relative_deg']:.3f}° | {r['drift_deg']:+.3f}° "
        f"| {r['median_ratio']:.2f}x | {r['p90_ratio']:.2f}x | {r.get('longest_ratio', math.nan):.2f}x |"
    )


if __name__ == "__main__":
    main()
