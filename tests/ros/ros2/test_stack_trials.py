"""Stacks that know the flat drive ten trials each over ROS 2: a server, an action server, one that a person starts."""

import json
import re
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.robots.driving_on import signed_in
from tests.robots.oracle_ways import OF_TRIALS, PLANNED, check_ten_successes, write_ways
from tests.ros.ros2.graph import HERE, Graph2, live_graph
from vsnbench.robots.profiles import profile_path

pytestmark = [pytest.mark.ros2, pytest.mark.long, pytest.mark.timeout(1500)]

ROOT = "/robot1"
ACTION = """
announce: {action: {name: navigate, type: test_msgs/action/Fibonacci, by_goal: {chair: {order: 0}, bed: {order: 1}}}}
arrived: {action: true}"""
BY_HTTP = """
announce: {http: 'ADDRESS/goal'}
arrived: {http: 'ADDRESS/state'}
abort: {http: 'ADDRESS/abort'}"""
BY_PERSON = """
announce: {operator: 'start the stack with the goal {goal}'}
arrived: {operator: true}
abort: {http: 'ADDRESS/abort'}"""


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 whose camera has small images, and the ways that the oracle takes in simulation."""
    directory = tmp_path_factory.mktemp("ros2")
    text = profile_path("turtlebot4").read_text()
    (directory / "small.yaml").write_text(text.replace("width: 640", "width: 160").replace("height: 360", "height: 90"))
    with live_graph(directory, shares_memory=True) as one:
        one.vsnbench("run", *PLANNED, "--results", directory / "oracle").wait(200)
        write_ways(directory / "oracle", directory / "ways.json")
        robot = one.vsnbench("robots", "simulate", f"{directory / 'small.yaml'}@{ROOT[1:]}")
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)
        yield one


def run(graph: Graph2, directory: Path, ways: str, *words: str | Path) -> Process:
    file = directory / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "1"{ways}\n')
    robot = f"{graph.directory / 'small.yaml'}@{ROOT[1:]}"
    trials = (*OF_TRIALS, "--results", directory / "results")
    return graph.vsnbench("run", "--robot", robot, "--model", f"stack:{file}", *trials, *words)


@pytest.mark.parametrize("kind", ["http", "action", "person"])
def test_ten_trials_are_announced_driven_and_judged(graph: Graph2, tmp_path: Path, kind: str) -> None:
    ways = "action" if kind == "action" else "http"
    stack = graph.start(HERE / "nodes" / "stack.py", ROOT, "{}", "--ways", ways, "--map", graph.directory / "ways.json")
    wait_until(lambda: re.search(r"listens \d+\n", stack.output), "the stack listens", 60)
    address = f"http://127.0.0.1:{stack.output.split('listens ')[1].split()[0]}"
    text = {"http": BY_HTTP, "action": ACTION, "person": BY_PERSON}[kind].replace("ADDRESS", address)
    for _ in range(3):  # the same command runs a void trial again, as where the machine starved the camera
        done = run(graph, tmp_path, text, *(("--console=:0",) if kind == "person" else ()))
        if kind == "person":
            threading.Thread(target=be_the_person, args=(done, address), daemon=True).start()
        if done.wait(1200) == 0:
            break
    stack.end()
    assert done.popen.returncode == 0, done.output
    check_ten_successes(tmp_path / "results", "operator" if kind == "person" else "declared")


def be_the_person(run: Process, address: str) -> None:
    """Let each trial begin, start the stack when the page says so, and say that it has arrived when it has."""
    anna = signed_in(run)
    begun = 0
    while run.popen.poll() is None:
        time.sleep(0.2)
        state = anna.ask("GET", "/state").json
        if (question := state["question"]) is not None:
            answer = "end" if question["kind"] == "finish" else "go"
            anna.post("/answer", question=question["number"], answer=answer)
        told = re.match(r"start the stack with the goal (\w+)$", state["whereabouts"])
        if not (told and state["driving"] and state["can_declare"]) or state["trial"]["episode"] == begun:
            continue
        begun = state["trial"]["episode"]
        urllib.request.urlopen(f"{address}/goal", json.dumps({"goal": told[1]}).encode()).close()
        while anna.ask("GET", "/state").json["driving"]:
            if json.load(urllib.request.urlopen(f"{address}/state"))["arrived"]:
                anna.post("/arrived")
            time.sleep(0.2)
