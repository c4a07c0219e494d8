"""Stacks that drive themselves over ROS 2: announced, watched, stopped and judged by `vsnbench run`."""

import json
import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, Graph2, live_graph
from vsnbench.robots.profiles import profile_path

pytestmark = pytest.mark.ros2

ROOT = "/robot1"
PATHS = {"sofa": [[0.9, 0.0]], "chair": [[0.6, 0.0]]}
"""From position 8, the first ends 0.9 m from the sofa."""
SHORT = {"sofa": [[0.4, 0.0]]}
"""Ends farther than 1 m from the sofa."""


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 in a namespace, whose camera has small images, simulated in the embedded apartment."""
    directory = tmp_path_factory.mktemp("ros2")
    profile = (
        profile_path("turtlebot4").read_text().replace("width: 640", "width: 160").replace("height: 360", "height: 90")
    )
    (directory / "small.yaml").write_text(profile)
    with live_graph(directory, shares_memory=True) as one:
        robot = one.vsnbench("robots", "simulate", robot_of(one))
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        yield one


def robot_of(graph: Graph2) -> str:
    return f"{graph.directory / 'small.yaml'}@{ROOT[1:]}"


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
        *("run", "--robot", robot_of(graph), "--model", f"stack:{file}", "--goal", "sofa", "--starts", "8"),
        *("--results", directory / "results", "--fail-fast", *words),
    )
    done.wait(250)
    return done, rows(directory, "select success, end_reason, reason from verdict order by id desc limit 1")


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
    steps = rows(
        tmp_path, "select action, raw_action from step where episode_id = (select max(id) from episode) order by number"
    )
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
    assert "goal sofa" in server.output
    assert "abort" in server.output


@pytest.mark.long
def test_a_command_that_ends_has_arrived_or_failed(graph: Graph2, tmp_path: Path) -> None:
    """The first path ends too far from the goal, and the second ends with another exit code."""
    ended = []
    for after in ("arrive", "fail"):
        words = [
            sys.executable,
            HERE / "nodes" / "stack.py",
            ROOT,
            json.dumps(SHORT),
            "--goal",
            "{goal}",
            "--after",
            after,
        ]
        directory = tmp_path / after
        directory.mkdir()
        _, verdicts = run(
            graph,
            directory,
            f"announce: {{command: {json.dumps(list(map(str, words)))}}}\narrived: {{exit_code: 0}}",
        )
        ended += [
            (verdict[:2], rows(directory, "select error from episode order by id desc limit 1")) for verdict in verdicts
        ]
    assert ended[0][0] == (0, "stop")
    assert ended[1][0] == (None, "model_error")
    assert "exit code 4" in ended[1][1][0][0]


@pytest.mark.long
def test_a_robot_at_rest_has_arrived_where_the_stack_says_nothing(graph: Graph2, tmp_path: Path) -> None:
    _, address = http_stack(graph, "--after", "wait")
    ways = ways_of(address).replace(f"{{http: '{address}/state'}}", "{rest_s: 2}")
    _, verdicts = run(graph, tmp_path, ways)
    assert [verdict[:2] for verdict in verdicts] == [(1, "stop")]
    assert rows(tmp_path, "select raw_action from step order by episode_id desc, number desc limit 1") == [("at rest",)]


@pytest.mark.long
def test_a_stack_that_drives_on_is_held_and_named(graph: Graph2, tmp_path: Path) -> None:
    _, address = http_stack(graph, "--after", "drive-on")
    _, verdicts = run(graph, tmp_path, ways_of(address))
    assert [verdict[1] for verdict in verdicts] == ["stop"]
    ((words,),) = rows(tmp_path, "select text from event where kind = 'drives_on'")
    assert "their_stack" in words


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "reason", "says"),
    [
        (("--after", "die"), "model_lost", "no stack answers"),
        (("--after", "fail"), "model_error", "no path to the goal"),
        (("--answer", "500"), "model_error", "answered 500"),
        (("--answer", "hang"), "model_lost", "did not answer"),
        (("--answer", "huge"), "model_error", "more than"),
    ],
)
def test_a_stack_that_fails_is_void_with_its_reason(
    graph: Graph2, tmp_path: Path, words: tuple[str, ...], reason: str, says: str
) -> None:
    _, address = http_stack(graph, *words)
    _, verdicts = run(graph, tmp_path, ways_of(address))
    ((error,),) = rows(tmp_path, "select error from episode order by id desc limit 1")
    assert [verdict[:2] for verdict in verdicts] == [(None, reason)]
    assert says in error
