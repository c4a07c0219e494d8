"""`vsnbench ros2 simulate --pretend-real` and a run with the page: placed, looked at, driven and judged over ROS 2."""

import sqlite3

import pytest

from tests.console.at_the_page import NAME, rehearse, written_profile
from tests.processes import wait_until
from tests.ros2.graph import live_graph

pytestmark = pytest.mark.ros2


def test_a_person_at_the_page_places_and_judges_a_robot_that_is_played_over_ros_2(tmp_path) -> None:
    robot = ["--robot", str(written_profile("turtlebot4", tmp_path))]
    words = ["run", *robot, "--model", "oracle", "--goal", "sofa", "--starts", "7", "--console-port", "0"]
    with live_graph(tmp_path) as graph:
        played = graph.vsnbench("ros2", "simulate", "--pretend-real", *robot)
        wait_until(lambda: "playing" in played.output, "the robot plays", 150)  # after the first compilation
        seen, run = rehearse(lambda: graph.vsnbench(*words, "--results", tmp_path / "r", COLUMNS="200"))
        seen.check(run.output)
    with sqlite3.connect(tmp_path / "r" / "vsnbench.db") as connection:
        judged = "select source, author, success from verdict where source = 'person'"
        assert connection.execute(judged).fetchall() == [("person", NAME, 1)]
