"""Robots of labs over ROS 2 in real time: twenty movements and a trial of each, on a stand-in of its base.

The stand-in is `vsnbench robots simulate` with the dead time, lag, deadbands, slip and noise of that base. It has no
camera of full size, so that a busy machine can play it; `tests/sensing/test_lab_robots.py` drives in virtual time.
"""

import math
import sqlite3
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from tests.processes import wait_until
from tests.robots.client import Client
from tests.robots.faulty_rig import is_overload, why_of
from tests.robots.lab_robots import ROBOTS, LabRobot, disagreement, movements
from tests.ros.ros2.graph import Graph2, client_of, live_graph
from vsnbench.robots.profiles import embedded_profiles
from vsnbench.values.pose import Pose

pytestmark = [pytest.mark.long, pytest.mark.ros2, pytest.mark.timeout(900)]

SITE = Path(__file__).parents[2] / "robots" / "lab_room.yaml"
ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second: the movement or the trial is done again."""
LIMIT_M, LIMIT_DEG = 0.06, 6.0
"""Largest difference between odometry and truth after one movement. Skidding bases turn without measuring it."""
JUDGED = """
    select verdict.success, verdict.end_reason, verdict.distance_m
    from verdict join episode on episode.id = episode_id where state = 'judged'
"""


def with_small_camera(robot: LabRobot, directory: Path) -> Path:
    """Write the profile with an image of a quarter of its width and height, ten times a second."""
    yaml = YAML()
    content = yaml.load(embedded_profiles().get(robot.robot, Path(robot.robot)).read_text(encoding="utf-8"))
    for side in ("width", "height"):
        content["camera"][side] //= 4
    content["interface"] |= {"camera_rate_hz": 10, "depth_frames": 3}
    path = directory / f"{content['name']}.yaml"
    yaml.dump(content, path)
    return path


@dataclass
class Session:
    """One robot, simulated in a graph."""

    graph: Graph2
    profile: Path
    results: Path

    def move(self, client: Client, movement: dict[str, Any]) -> tuple[dict[str, Any], float, float]:
        """Return the result of one movement, and by how much its odometry is wrong: metres and degrees."""
        for _ in range(ATTEMPTS):
            before = self._poses(client)
            result = client("drive", movement)
            if result["completed"] or not is_overload(why_of(result)):
                break
        after = self._poses(client)
        off_m, off_rad = disagreement((before[0], after[0]), (before[1], after[1]))
        return result, off_m, math.degrees(off_rad)

    @staticmethod
    def _poses(client: Client) -> tuple[Pose, Pose]:
        """Return the true pose and that of the odometry, at rest."""
        odometry = Pose(*client("observe")["pose"])
        return Pose(*client("locate")[:3]), odometry

    def trial(self) -> list[tuple]:
        """Run one trial, again while it is void, and return its verdict."""
        words = ["run", "--robot", self.profile, "--site", SITE, "--model", "oracle", "--goal", "chair"]
        for _ in range(ATTEMPTS):
            done = self.graph.vsnbench(*words, "--starts", "1", "--results", self.results)
            if done.wait(200) == 0 or "the same command resumes" not in done.output:
                break
        assert done.popen.returncode == 0, done.output
        with sqlite3.connect(self.results / "vsnbench.db") as connection:
            return connection.execute(JUDGED).fetchall()


@pytest.fixture(params=ROBOTS)
def session(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Session]:
    robot = ROBOTS[request.param]
    profile = with_small_camera(robot, tmp_path)
    with live_graph(tmp_path, shares_memory=True) as graph:
        base = [] if robot.base is None else ["--base", robot.base]
        played = graph.vsnbench("robots", "simulate", profile, "--site", SITE, *base)
        wait_until(lambda: "simulating" in played.output, "the robot is simulated", 150)  # after the first compilation
        yield Session(graph, profile, tmp_path / "results")


def test_a_robot_drives_twenty_movements_and_a_trial(session: Session, request: pytest.FixtureRequest) -> None:
    name = request.node.callspec.params["session"]
    client = client_of(session.graph, session.profile, 60.0)
    try:
        client("begin", 5.0, 5.0, 0.0)
        wrong, worst_m, worst_deg, took_s = {}, 0.0, 0.0, 0.0
        for movement in movements(ROBOTS[name].profile):
            result, off_m, off_deg = session.move(client, movement.to_json())
            worst_m, worst_deg = max(worst_m, off_m), max(worst_deg, off_deg)
            took_s += result["duration_s"]
            if not result["completed"] or off_m > LIMIT_M or off_deg > LIMIT_DEG:
                wrong[movement.text] = why_of(result), off_m, off_deg
    finally:
        client.close()
    sys.stdout.write(
        f"{name}: {20 - len(wrong)} of 20 movements in {took_s:.0f} s, odometry off by at most {worst_m * 1000:.0f} mm "
        f"and {worst_deg:.1f} degrees\n"
    )
    assert wrong == {}
    ((success, reason, distance_m),) = session.trial()
    sys.stdout.write(f"{name}: trial: {reason}, {distance_m:.2f} m\n")
    assert (success, reason) == (1, "stop")
