"""`vsnbench ros1 simulate --pretend-real` and a run with the page: placed, looked at, driven and judged over ROS 1."""

import sqlite3

import pytest

from tests.console.at_the_page import NAME, rehearse, written_profile
from tests.ros1.network import live_network, wait_until

pytestmark = pytest.mark.ros


def test_a_person_at_the_page_places_and_judges_a_robot_that_is_played_over_ros_1(tmp_path) -> None:
    profile = written_profile("turtlebot2", tmp_path)
    robot = ["--robot", str(profile)]
    words = ["run", *robot, "--model", "oracle", "--goal", "sofa", "--starts", "7", "--console-port", "0"]
    with live_network(tmp_path) as network:
        played = network.start("-m", "vsnbench.cli.main", "ros1", "simulate", "--pretend-real", *robot)
        network.start("-m", "vsnbench.cli.main", "ros1", "discrete-move", *robot)
        wait_until(lambda: "playing" in played.output, "the robot plays", 150)  # after the first compilation
        network.wait_for_service("/discrete_move")
        words += ["--results", str(tmp_path / "r")]
        seen, run = rehearse(lambda: network.start("-m", "vsnbench.cli.main", *words, COLUMNS="200"))
        seen.check(run.output)
    with sqlite3.connect(tmp_path / "r" / "vsnbench.db") as connection:
        judged = "select source, author, success from verdict where source = 'person'"
        assert connection.execute(judged).fetchall() == [("person", NAME, 1)]
        placed = "select author, determined, within_tolerance from placement join episode e on e.id = episode_id"
        assert connection.execute(f"{placed} where e.state = 'judged'").fetchall() == [(NAME, 1, 1)]
        battery = connection.execute("select text from event where kind = 'battery' order by id").fetchall()
        assert battery[0][0].endswith("%")
