"""A stack that drives itself over ROS 1: told a goal on a topic, watched, heard, and judged by `vsnbench run`."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros.ros1.network import HERE, Process, RosNetwork, live_network, wait_until

pytestmark = pytest.mark.ros

PATHS = {"sofa": [[0.9, 0.0]], "chair": [[0.6, 0.0]]}
"""From position 8, the first ends 0.9 m from the sofa."""
WAYS = """
announce: {topic: {name: /their/goal, type: std_msgs/String, content: {data: "{goal}"}}}
arrived: {topic: {name: /their/state, type: std_msgs/String, equals: arrived, failed: failed}}
abort: {topic: {name: /their/abort, type: std_msgs/Empty}}
"""


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosNetwork]:
    """A network with a TurtleBot 2 that is simulated in the embedded apartment."""
    with live_network(tmp_path_factory.mktemp("ros")) as ros:
        ros.start("-m", "vsnbench.cli.main", "robots", "simulate", "turtlebot2")
        ros.start("-m", "vsnbench.cli.main", "robots", "serve", "turtlebot2")
        ros.wait_for_service("/discrete_move", 150.0)
        yield ros


def run(network: RosNetwork, directory: Path, *words: str, ways: str = WAYS) -> Process:
    file = directory / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "1"\n{ways}')
    results = ("--results", str(directory / "results"), "--fail-fast")
    one = network.run("--robot", "turtlebot2", "--model", f"stack:{file}", "--starts", "8", *results, *words)
    one.wait(150)
    return one


def rows(directory: Path, query: str) -> list[tuple]:
    with sqlite3.connect(directory / "results" / "vsnbench.db") as connection:
        return connection.execute(query).fetchall()


def start_stack(network: RosNetwork, after: str) -> Process:
    stack = network.start(HERE / "nodes" / "stack.py", json.dumps(PATHS), after)
    wait_until(lambda: "listens" in stack.output, "the stack listens")
    return stack


def test_two_goals_are_announced_driven_and_judged(network: RosNetwork, tmp_path: Path) -> None:
    """The state of the first trial still says "arrived" when the second goal is announced."""
    stack = start_stack(network, "arrived")
    done = run(network, tmp_path, "--goal", "sofa", "--goal", "chair")
    stack.end()
    assert done.popen.returncode == 0, done.output
    assert "can also steer" not in done.output, "its commands are expected"
    assert rows(tmp_path, "select success, end_reason from verdict order by id") == [(1, "stop"), (0, "stop")]
    driven_m = [path_m for (path_m,) in rows(tmp_path, "select path_length_m from episode order by id")]
    assert driven_m == pytest.approx([0.9, 0.6], abs=0.1)
    steps = rows(tmp_path, "select raw_action from step where action = 'STOP'")
    assert steps == [("declared",)] * 2
    assert stack.output.split()[-6:] == ["goal", "sofa", "abort", "goal", "chair", "abort"]


@pytest.mark.long
def test_a_stack_that_fails_is_void(network: RosNetwork, tmp_path: Path) -> None:
    stack = start_stack(network, "failed")
    run(network, tmp_path, "--goal", "sofa")
    stack.end()
    ((reason, error),) = rows(
        tmp_path, "select verdict.end_reason, error from verdict join episode on episode.id = episode_id"
    )
    assert (reason, "says that it failed: /their/state failed" in error) == ("model_error", True)


@pytest.mark.long
@pytest.mark.parametrize(
    ("ways", "says"),
    [
        (WAYS, "no node publishes /their/state (std_msgs/String)"),
        (WAYS.replace("std_msgs/Empty", "their_msgs/Abort"), "message type their_msgs/Abort is not installed here"),
        (WAYS.replace("{data:", "{word:"), "the content does not fit std_msgs/String: No field name [word]"),
        (
            "announce: {action: {name: /go, type: their_msgs/action/Go}}\narrived: {action: true}",
            "an action needs ROS 2",
        ),
    ],
    ids=["silent-topic", "unknown-type", "unknown-field", "action"],
)
def test_nothing_moves_where_a_stack_cannot_be_told(network: RosNetwork, tmp_path: Path, ways: str, says: str) -> None:
    done = run(network, tmp_path, "--goal", "sofa", ways=ways)
    assert done.popen.returncode != 0
    assert says in done.output
    if (tmp_path / "results" / "vsnbench.db").exists():
        assert all(path_m < 0.02 for (path_m,) in rows(tmp_path, "select path_length_m from episode"))
