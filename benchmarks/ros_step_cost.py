"""Measures the overhead of a step over ROS in milliseconds.

The overhead is the time of a step without the motion, the model and the wait for depth frames. The script starts a
master, `vsnbench robots simulate` and `vsnbench robots serve`, executes steps as the client does, and splits each into
its parts. Upstream's loop sleeps 1 to 1.5 s per step; vsnbench waits only until its inputs have arrived.

    python benchmarks/ros_step_cost.py --steps 40
"""

import argparse
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--steps", type=int, default=40)
    options.add_argument("--robot", default="turtlebot2")
    chosen = options.parse_args()
    with ExitStack() as stack:
        directory = stack.enter_context(tempfile.TemporaryDirectory())
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        os.environ |= {
            "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": directory,
            "ROS_LOG_DIR": directory,
        }

        def start(*words: str) -> None:
            process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        rosmaster = shutil.which("rosmaster", path=f"{sys.prefix}/bin:/usr/bin") or "rosmaster"
        start(sys.executable, rosmaster, "--core", "-p", str(port))
        from vsnbench.ros.ros1.master import Master

        Master.from_environment().wait(20)
        vsnbench = [sys.executable, "-m", "vsnbench.cli.main", "robots"]
        start(*vsnbench, "simulate", chosen.robot)
        start(*vsnbench, "serve", chosen.robot)
        sys.stdout.write(measure(chosen.robot, chosen.steps))


def measure(name: str, steps: int) -> str:
    """Alternate turns on the spot with observations, `steps` times; return the table."""
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.robots.profiles import load_profile
    from vsnbench.robots.ros.robot import RosRobot
    from vsnbench.ros.ros1.interface import ros1_interface
    from vsnbench.sites.site import load_site
    from vsnbench.values.movement import Action

    left, right = (ProtocolParameters().movement_of(action) for action in (Action.TURN_LEFT, Action.TURN_RIGHT))
    parts: dict[str, list[float]] = {part: [] for part in PARTS}
    with RosRobot(load_profile(name), patience_s=60) as robot:
        robot.begin(load_site("apartment").start(1), seed=0)
        robot.observe()
        names = ros1_interface(robot.profile)
        frames_s = names.depth_frames / names.camera_rate_hz
        for step in range(steps):
            began_s = time.perf_counter()
            result = robot.drive(left if step % 2 else right)
            moved_s = time.perf_counter()
            seen = robot.observe()
            ended_s = time.perf_counter()
            outcome, waited_s = robot.movements.outcome, seen.sensing["waited_s"]
            if not result.completed or outcome is None:
                sys.stderr.write(f"step {step}: {result.failure}\n")
                continue
            parts["step"].append(ended_s - began_s)
            parts["motion"].append(outcome.duration_s)
            parts["frames"].append(min(frames_s, waited_s))
            parts["call"].append(moved_s - began_s - outcome.duration_s)
            parts["wait"].append(max(waited_s - frames_s, 0.0))
            parts["compute"].append(seen.sensing["computed_s"])
            parts["ours"].append(ended_s - began_s - outcome.duration_s - min(frames_s, waited_s))
    lines = [f"{name}, {len(parts['step'])} steps", "", "| part of a step | median | p90 |", "| --- | --- | --- |"]
    for part, words in PARTS.items():
        median, p90 = statistics.median(parts[part]), statistics.quantiles(parts[part], n=10)[-1]
        lines.append(f"| {words} | {median * 1000:.1f} ms | {p90 * 1000:.1f} ms |")
    return "\n".join(lines) + "\n"


PARTS = {
    "step": "the whole step, no model",
    "motion": "motion with settling (clock of discrete_move)",
    "frames": "duration of the depth frames",
    "call": "service call, and detecting that the robot is at rest",
    "wait": "waiting for images beyond the depth frames",
    "compute": "decoding and the median",
    "ours": "**total overhead of vsnbench**",
}

if __name__ == "__main__":
    main()
