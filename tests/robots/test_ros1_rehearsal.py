"""A rehearsal over ROS 1: `vsnbench robots simulate --rehearse`, and a run with the operator's page."""

import sqlite3

import pytest

from tests.ros.ros1.network import live_network, wait_until
from tests.web.ros_operator import NAME, rehearse, written_profile

pytestmark = pytest.mark.ros


def test_a_rehearsal_over_ros_1_is_placed_and_judged_on_the_page(tmp_path) -> None:
    profile = str(written_profile("turtlebot2", tmp_path))
    robot = ["--robot", profile]
    words = ["run", *robot, "--model", "oracle", "--goal", "sofa", "--starts", "7", "--console=:0"]
    with live_network(tmp_path) as network:
        played = network.start("-m", "vsnbench.cli.main", "robots", "simulate", "--rehearse", profile)
        network.start("-m", "vsnbench.cli.main", "robots", "serve", profile)
        wait_until(lambda: "simulating" in played.output, "the robot is simulated", 150)  # after the first compilation
        network.wait_for_service("/discrete_move")
        words += ["--results", str(tmp_path / "r")]
        seen, run = rehearse(lambda: network.start("-m", "vsnbench.cli.main", *words, COLUMNS="200"))
        seen.check(run.output)
    with sqlite3.connect(tmp_path / "r" / "vsnbench.db") as connection:
        judged = "select source, author, success from verdict where source = 'person'"
        assert connection.execute(judged).fetchall() == [("person", NAME, 1)]
        placed = "select author, determined, within_tolerance from placement join episode e on e.id = episode_id"
        assert connection.execute(f"{placed} where e.state = 'judged' and moment = 'start'").fetchall() == [
            (NAME, 1, 1)
        ]
        battery = connection.execute("select text from event where kind = 'battery' order by id").fetchall()
        assert battery[0][0].endswith("%")
