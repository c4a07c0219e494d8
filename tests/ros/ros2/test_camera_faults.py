"""`doctor` and an observation tell a frozen, half blind, slow and late camera apart, over ROS 2."""

import sys

import pytest

from tests.robots.camera_faults import require_frozen_half, require_slow_and_late, require_slow_camera_ends
from tests.robots.client import Client
from tests.robots.fault_table import checks_of
from tests.ros.ros2.graph import HERE, PROFILE, live_graph, send_line

# Daily, tests/robots/checkup and tests/robots/ros/test_image_timing.py tell them apart, and test_faults.py is live.
pytestmark = [pytest.mark.ros2, pytest.mark.long]


def test_faults_of_a_camera_are_told_apart(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        send_line(robot, "timeout 0.5")

        def doctor(*words: str) -> dict[str, tuple[str, str]]:
            return checks_of(graph.vsnbench("doctor", "--robot", PROFILE, "--results", tmp_path, "--json", *words))

        send_line(robot, "frozen+half")
        require_frozen_half(doctor("--move"))  # it also measures the watchdog, without which no client steers the base
        send_line(robot, "slow+late")
        require_slow_and_late(doctor())
        send_line(robot, "good")
        client = Client(graph, (sys.executable,), PROFILE, 20.0)
        try:
            require_slow_camera_ends(client, lambda: send_line(robot, "slow"))
        finally:
            client.close()
