"""Counts collisions, refusals and end reasons of a robot with a faulty camera.

A model that always chooses MOVE_FORWARD drives up to 25 actions from each of 8 starts of the apartment, once for each
state of the camera. Where half of the depth is missing, it turns after each refusal. In simulation, the script changes
the observation. Over ROS, the node that simulates the robot (`tests/robots/nodes/faulty_robot.py`) publishes faulty
images. Set ROS_DOMAIN_ID or ROS_MASTER_URI to an unused network.

    python benchmarks/blind_camera.py simulation
    python benchmarks/blind_camera.py ros2 --fault nan --fault frozen
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.robots.blind_camera import FAULTS, NODE, Counts, FaultyRobot, ForwardOnly, drive
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.registry import open_robot
from vsnbench.sites.site import load_site
from vsnbench.values.movement import STOP

PATIENCE_S = 20.0
ROBOTS = {"simulation": "turtlebot2", "ros1": "turtlebot2", "ros2": "turtlebot4"}


class FaultyNode:
    """A separate process with the node that simulates a robot over ROS."""

    def __init__(self, generation: str, robot: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(NODE), generation, robot],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def set_fault(self, fault: str) -> None:
        """Set the fault of the camera, and wait until the node confirms it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{fault}\n")
        self._process.stdin.flush()
        if not self._process.stdout.readline():
            raise SystemExit("the node ended early")

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.wait(PATIENCE_S)


def model_for(fault: str) -> ForwardOnly:
    """Return the model; only turns tell a fault of half of the image from an obstacle."""
    return ForwardOnly(turns=fault == "left half")


def over_ros(where: str, faults: Sequence[str], starts: Sequence[int], actions: int) -> Iterator[tuple[str, Counts]]:
    """Drive a simulated robot over ROS. Its camera works while the robot is placed at a start."""
    site, node = load_site("apartment"), FaultyNode(where, ROBOTS[where])
    try:
        node.set_fault("right")
        with open_robot(ROBOTS[where], site, ProtocolParameters()) as robot:
            for fault in faults:

                def begin_fault(fault: str = fault) -> None:
                    node.set_fault(fault)
                    robot.drive(STOP)  # the robot only accepts images newer than its last action

                counts = Counts()
                for start in starts:
                    node.set_fault("right")
                    counts += drive(robot, site, [start], actions, begin_fault, model_for(fault))
                yield fault, counts
    finally:
        node.close()


def simulated(faults: Sequence[str], starts: Sequence[int], actions: int) -> Iterator[tuple[str, Counts]]:
    """Drive the simulated robot in this process."""
    site = load_site("apartment")
    robot = FaultyRobot(site, load_profile(ROBOTS["simulation"]))
    for robot.fault in faults:
        yield robot.fault, drive(robot, site, starts, actions, policy=model_for(robot.fault))


def main() -> None:
    """Run the measurement and print the counts of each fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("where", choices=ROBOTS)
    parser.add_argument("--starts", type=int, nargs="+", default=range(1, 9))
    parser.add_argument("--actions", type=int, default=25, help="maximum number of actions per episode")
    parser.add_argument("--fault", action="append", choices=[*FAULTS, "ahead"], help="default: all but ahead")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    faults = chosen.fault or FAULTS
    if chosen.where == "simulation":
        results = simulated(faults, chosen.starts, chosen.actions)
    else:
        results = over_ros(chosen.where, faults, chosen.starts, chosen.actions)
    for fault, counts in results:
        print(json.dumps({"fault": fault, **counts.numbers()}) if chosen.json else f"{fault}: {counts}", flush=True)


if __name__ == "__main__":
    main()
