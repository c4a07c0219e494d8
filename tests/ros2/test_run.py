"""`vsnbench ros2 simulate` and `vsnbench run`, in real time: the same actions as in simulation."""

import sqlite3
from pathlib import Path

import pytest

from tests.ros2.graph import live_graph

pytestmark = pytest.mark.ros2

ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second: the episode is void, and is run again."""
JUDGED = """
    select success, verdict.end_reason, distance_source from verdict join episode on episode.id = episode_id
    where state = 'judged'
"""


def rows(results: Path, query: str) -> list[tuple]:
    with sqlite3.connect(results / "vsnbench.db") as connection:
        return connection.execute(query).fetchall()


def test_the_rehearsal_takes_the_same_actions_as_the_simulation(tmp_path) -> None:
    with live_graph(tmp_path) as graph:

        def run(robot: str) -> None:
            words = ["run", "--robot", robot, "--model", "oracle", "--goal", "sofa", "--starts", "7"]
            for _ in range(ATTEMPTS):
                done = graph.vsnbench(*words, "--results", tmp_path / robot)
                if done.wait(200) == 0 or "the same command goes on" not in done.output:
                    break
            assert done.popen.returncode == 0, done.output

        graph.vsnbench("ros2", "simulate", "--robot", "turtlebot4@robot1")
        run("turtlebot4@robot1")
        run("simulated:turtlebot4")
        over_ros = tmp_path / "turtlebot4@robot1"
        assert rows(over_ros, "select kind, simulated from robot") == [("ros2", 1)]
        assert rows(over_ros, JUDGED) == [(1, "stop", "simulated")]
        assert actions(over_ros) == actions(tmp_path / "simulated:turtlebot4")


def actions(results: Path) -> list[tuple]:
    judged = "join episode on episode.id = episode_id where state = 'judged'"
    return rows(results, f"select number, action from step {judged} order by number")
