"""A robot that Nav2's action servers move, driven by the example's adapter over a ROS 2 graph.

The servers are a stand-in (`nodes/nav2_servers.py`); the actions have the definitions of nav2_msgs.
"""

import math
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.robots.client import Client
from tests.robots.faulty_rig import is_overload, why_of
from tests.ros.ros2.graph import HERE, Graph2, client_of, live_graph
from tests.ros.ros2.interface_package import can_have, package_of
from tests.ros.ros2.test_motion_adapter import EXAMPLE, JUDGED, SITE, profile_with_adapter
from vsnbench.values.movement import Drive, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

pytestmark = [
    pytest.mark.long,
    pytest.mark.ros2,
    pytest.mark.timeout(1500),
    pytest.mark.skipif(not can_have("nav2_msgs"), reason="needs nav2_msgs, or gcc and the generators of the wheels"),
]
ATTEMPTS = 4
"""A busy machine delays a base by more than the checks allow, and a sensor may fall silent for a second."""
TOLERANCES = "position_m: 0.06, turn_deg: 5"
"""Those of the stand-in's goal checker, and what a turn overshoots in a cycle of 10 Hz."""
TRAJECTORY = Trajectory(((0.3, 0.0), (0.6, 0.1), (0.8, 0.3)))
ENDS: dict[Drive, Pose] = {
    Move(0.25, 0.0, True): Pose(0.25, 0.0),
    Move(0.0, math.radians(30), True): Pose(0.0, 0.0, math.radians(30)),
    Move(-0.25): Pose(-0.25, 0.0),
    Move(0.5, math.radians(-60)): Pose(0.0, 0.0, math.radians(-60)).compose(Pose(0.5, 0.0)),
    Waypoint(0.6, -0.3): Pose(0.6, -0.3, math.atan2(-0.3, 0.6)),
    Waypoint(-0.5, 0.4, 1.0): Pose(-0.5, 0.4, 1.0),
    TRAJECTORY: Pose(0.8, 0.3, math.pi / 4),
}
"""Where movements end in the frame of their start."""
RIVAL = """
import rclpy
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import FollowPath
from rclpy.action import ActionClient
rclpy.init()
node = rclpy.create_node("rival")
client, goal = ActionClient(node, FollowPath, "follow_path"), FollowPath.Goal()
client.wait_for_server()
goal.path.poses.append(PoseStamped())
print("up")
input()
rclpy.spin_until_future_complete(node, client.send_goal_async(goal), timeout_sec=30)
"""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path | None:
    return package_of("nav2_msgs", tmp_path_factory)


@contextmanager
def nav2(directory: Path, packages: Path | None, *words: str) -> Iterator[tuple[Graph2, Path]]:
    """Yield a graph with a simulated robot, the servers that move it and the adapter; and the robot's profile."""
    profile = profile_with_adapter(directory, TOLERANCES)
    with live_graph(directory, shares_memory=True, packages=packages) as graph:
        robot = graph.vsnbench("robots", "simulate", profile, "--site", SITE)
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        servers = graph.start(HERE / "nodes" / "nav2_servers.py", *words)
        adapter = graph.start(EXAMPLE, "nav2_adapter:Nav2")
        for process, up in ((servers, "up"), (adapter, "serving")):
            wait_until(lambda one=process, word=up: word in one.output, "the node is up")
        yield graph, profile


def drive(client: Client, movement: Drive) -> dict:
    """Return the result of a movement, which a busy machine may make necessary several times."""
    for _ in range(ATTEMPTS):
        result = client("drive", movement.to_json())
        if result["completed"] or not is_overload(why_of(result)):
            break
    return result


def test_movements_are_goals_of_nav2_and_end_where_they_should(tmp_path: Path, packages: Path | None) -> None:
    with nav2(tmp_path, packages) as (graph, profile):
        client = client_of(graph, profile, 60.0)
        try:
            client("begin", 5.0, 5.0, 0.0)
            for movement, end in ENDS.items():
                before = Pose(*client("locate")[:3])
                result = drive(client, movement)
                assert result["completed"], (movement.text, why_of(result))
                after = Pose(*client("locate")[:3]).relative_to(before)
                off_deg = math.degrees(math.remainder(after.heading_rad - end.heading_rad, math.tau))
                sys.stdout.write(f"{movement.text}: {after.distance_to(end):.3f} m, {off_deg:.1f} degrees\n")
                assert after.distance_to(end) < 0.1
                assert abs(off_deg) < 8
            assert "Nav2 has no action for velocity" in why_of(drive(client, Velocity(0.2)))
        finally:
            client.close()


def test_a_goal_of_another_client_ends_a_movement_as_a_rivals(tmp_path: Path, packages: Path | None) -> None:
    with nav2(tmp_path, packages) as (graph, profile):
        rival = graph.start("-c", RIVAL)
        wait_until(lambda: "up" in rival.output, "the rival is up")
        client = client_of(graph, profile, 60.0)
        try:
            client("begin", 5.0, 5.0, 0.0)
            driving = client.later("drive", Move(2.0).to_json())
            wait_until(lambda: "accepted" in graph.processes[1].output, "the robot drives")
            assert rival.popen.stdin is not None
            rival.popen.stdin.write(b"\n")
            rival.popen.stdin.flush()
            assert "another client ended the goal of follow_path" in why_of(driving.result(60))
        finally:
            client.close()


def test_a_robot_that_makes_no_progress_is_blocked_and_stays(tmp_path: Path, packages: Path | None) -> None:
    with nav2(tmp_path, packages, "--stuck-after", "0.4") as (graph, profile):
        client = client_of(graph, profile, 60.0)
        try:
            client("begin", 5.0, 5.0, 0.0)
            assert drive(client, Move(0.25))["completed"]
            result = drive(client, Move(1.0))
            assert result["blocked"] == "follow_path: Failed to make progress (105)", result
        finally:
            client.close()


@pytest.mark.parametrize("model", ["oracle", "oracle-waypoints"])
def test_a_trial_runs_through_nav2(tmp_path: Path, packages: Path | None, model: str) -> None:
    results = tmp_path / "results"
    with nav2(tmp_path, packages) as (graph, profile):
        words = ["--robot", profile, "--site", SITE, "--model", model, "--goal", "chair", "--starts", "1"]
        for _ in range(ATTEMPTS):
            done = graph.vsnbench("run", *words, "--results", results)
            if done.wait(300) == 0 or "the same command resumes" not in done.output:
                break
        assert done.popen.returncode == 0, done.output
    with sqlite3.connect(results / "vsnbench.db") as connection:
        assert connection.execute(JUDGED).fetchall() == [(1, "stop")]
        (conditions,) = connection.execute("select conditions from campaign").fetchone()
        assert "nav2" in conditions
