"""`vsnbench robots simulate` and `vsnbench run` in real time: actions as in simulation. `test_stack` kills a run."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.robots.drives import DRIVING_ON, check_answers
from tests.ros.ros2.graph import Graph2, live_graph

pytestmark = pytest.mark.ros2

ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second: the episode is void, and is run again."""
JUDGED = """
    select success, verdict.end_reason, verdict.distance_source from verdict join episode on episode.id = episode_id
    where state = 'judged'
"""


def rows(results: Path, query: str) -> list[tuple]:
    with sqlite3.connect(results / "vsnbench.db") as connection:
        return connection.execute(query).fetchall()


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 in namespace robot1, simulated in the embedded apartment."""
    with live_graph(tmp_path_factory.mktemp("ros2"), shares_memory=True) as one:
        robot = one.vsnbench("robots", "simulate", "turtlebot4@robot1")
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        yield one


def begin(graph: Graph2, robot: str, results: Path, model: str = "oracle") -> Process:
    words = ["run", "--robot", robot, "--model", model, "--goal", "sofa", "--starts", "7"]
    return graph.vsnbench(*words, "--results", results)


def run(graph: Graph2, robot: str, results: Path, model: str = "oracle") -> None:
    for _ in range(ATTEMPTS):
        done = begin(graph, robot, results, model)
        if done.wait(200) == 0 or "the same command resumes" not in done.output:
            break
    assert done.popen.returncode == 0, done.output


def test_the_rehearsal_takes_the_same_actions_as_the_simulation(graph, tmp_path) -> None:
    over_ros, simulated = tmp_path / "ros", tmp_path / "simulated"
    run(graph, "turtlebot4@robot1", over_ros)
    run(graph, "simulated:turtlebot4", simulated)
    assert rows(over_ros, "select kind, simulated from robot") == [("ros2", 1)]
    assert rows(over_ros, JUDGED) == [(1, "stop", "simulated")]
    assert actions(over_ros) == actions(simulated)


@pytest.mark.long
def test_a_run_that_drives_on_is_recorded_with_the_ages_of_its_answers(graph, tmp_path) -> None:
    """The workstation steers the base while the model thinks."""
    model = ["--model", "tests.robots.onward:Onward", "--goal", "sofa"]
    words = ["run", "--robot", "turtlebot4@robot1", *model, *DRIVING_ON]
    done = graph.vsnbench(*words, "--results", tmp_path)
    assert done.wait(200) == 0, done.output
    assert rows(tmp_path, "select end_reason, distance_source from verdict") == [("time_limit", "simulated")]
    check_answers(rows(tmp_path, "select stamp_s, movement, duration_s from step order by number"))


@pytest.mark.long
def test_a_chunk_of_turns_gives_a_model_the_image_and_the_odometry_after_each(graph, tmp_path) -> None:
    run(graph, "turtlebot4@robot1", tmp_path, "tests.robots.panorama:Panorama")
    judged = "from step join episode on episode.id = episode_id where state = 'judged' order by number"
    recorded = rows(tmp_path, f"select stamp_s, details {judged}")
    stamps_s, turned_deg, _ = zip(*json.loads(recorded[-1][1])["seen"], strict=True)
    assert stamps_s == tuple(stamp_s for stamp_s, _ in recorded[1:])
    assert [angle % 360 for angle in turned_deg[:-1]] == pytest.approx([30 * k for k in range(1, 12)], abs=2)


def actions(results: Path) -> list[tuple]:
    judged = "join episode on episode.id = episode_id where state = 'judged'"
    return rows(results, f"select number, action from step {judged} order by number")
