"""Stacks that drive themselves over ROS 2: announced, watched, stopped and judged by `vsnbench run`."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, Graph2, live_graph

pytestmark = pytest.mark.ros2

ROOT = "/robot1"
PATHS = {"sofa": [[0.9, 0.0]], "chair": [[0.6, 0.0]]}
"""From position 8, the first ends 0.9 m from the sofa."""
SHORT = {"sofa": [[0.4, 0.0]]}
"""Ends farther than 1 m from the sofa."""


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 in a namespace, simulated in the embedded apartment."""
    with live_graph(tmp_path_factory.mktemp("ros2"), shares_memory=True) as one:
        robot = one.vsnbench("robots", "simulate", f"turtlebot4@{ROOT[1:]}")
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        yield one


def http_stack(graph: Graph2, *words: str, paths: dict[str, list[list[float]]] = PATHS) -> tuple[Process, str]:
    """Start the stack as a server, and return it with its address."""
    server = graph.start(HERE / "nodes" / "stack.py", ROOT, json.dumps(paths), *words)
    wait_until(lambda: "listens" in server.output, "the stack listens", 60)
    return server, f"http://127.0.0.1:{server.output.split('listens ')[1].split()[0]}"


def run(graph: Graph2, directory: Path, ways: str, *words: str) -> tuple[Process, list[tuple]]:
    """Run a trial of a stack, and return the command and the ends of its episodes."""
    file = directory / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "1"\n{ways}\n')
    done = graph.vsnbench(
        *("run", "--robot", f"turtlebot4@{ROOT[1:]}", "--model", f"stack:{file}", "--goal", "sofa", "--starts", "8"),
        *("--results", directory / "results", *words),
    )
    done.wait(250)
    return done, rows(directory, "select success, end_reason, reason from verdict order by id")


def rows(directory: Path, query: str) -> list[tuple]:
    with sqlite3.connect(directory / "results" / "vsnbench.db") as connection:
        return connection.execute(query).fetchall()


def ways_of(address: str) -> str:
    goal, state, abort = (f"{{http: '{address}/{name}'}}" for name in ("goal", "state", "abort"))
    return f"announce: {goal}\narrived: {state}\nabort: {abort}"


def test_a_stack_that_declares_its_arrival_is_judged_at_rest(graph: Graph2, tmp_path: Path) -> None:
    server, address = http_stack(graph)
    done, verdicts = run(graph, tmp_path, ways_of(address))
    assert done.popen.returncode == 0, done.output
    assert [verdict[:2] for verdict in verdicts] == [(1, "stop")]
    steps = rows(tmp_path, "select action, raw_action from step order by number")
    assert set(steps[:-1]) == {("NOOP", "drives")}
    assert steps[-1] == ("STOP", "declared")
    ((protocol,),) = rows(tmp_path, "select protocol from campaign")
    assert (json.loads(protocol)["execution"]["driver"], json.loads(protocol)["depth_guard"]["enabled"]) == (
        "stack",
        False,
    )
    films = [
        json.loads(details)["sensing"].get("film", []) for (details,) in rows(tmp_path, "select details from step")
    ]
    assert max(frame[5] for film in films for frame in film) == pytest.approx(0.25)  # m/s, as the stack commanded
    assert server.output.count("goal sofa") == 1
    assert "abort" in server.output
