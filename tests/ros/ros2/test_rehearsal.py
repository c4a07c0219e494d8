"""A rehearsal over ROS 2: `vsnbench robots simulate --rehearse`, and a run with the operator's page."""

import sqlite3

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import live_graph
from tests.web.ros_operator import NAME, rehearse, written_profile

pytestmark = [pytest.mark.ros2, pytest.mark.long]


def test_a_rehearsal_over_ros_2_is_placed_and_judged_on_the_page(tmp_path) -> None:
    profile = str(written_profile("turtlebot4", tmp_path))
    robot = ["--robot", profile]
    words = ["run", *robot, "--model", "oracle", "--goal", "sofa", "--starts", "7", "--console=:0"]
    with live_graph(tmp_path, shares_memory=True) as graph:
        played = graph.vsnbench("robots", "simulate", "--rehearse", profile)
        wait_until(lambda: "simulating" in played.output, "the robot is simulated", 150)  # after the first compilation
        measured = graph.vsnbench("doctor", *robot, "--move", "--results", tmp_path / "doctor")
        assert measured.wait(120) == 0, measured.output
        seen, run = rehearse(lambda: graph.vsnbench(*words, "--results", tmp_path / "r", COLUMNS="200"))
        seen.check(run.output)
    with sqlite3.connect(tmp_path / "r" / "vsnbench.db") as connection:
        judged = "select source, author, success from verdict where source = 'person'"
        assert connection.execute(judged).fetchall() == [("person", NAME, 1)]
