"""A person drives a robot over ROS 2 through the page, behind the same guard as a model."""

import re
import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import Graph2, live_graph
from tests.web.browser import Browser
from vsnbench.robots.profiles import profile_path

pytestmark = [pytest.mark.ros2, pytest.mark.long, pytest.mark.timeout(600)]

LONGEST_WAY = 20
"""Actions forward until something is ahead, at most."""


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph2]:
    """A graph with a TurtleBot 4 whose camera has small images."""
    text = profile_path("turtlebot4").read_text()
    (tmp_path / "small.yaml").write_text(text.replace("width: 640", "width: 160").replace("height: 360", "height: 90"))
    (tmp_path / "vsnbench.toml").write_text("[console]\nport = 0\n")
    with live_graph(tmp_path, shares_memory=True) as one:
        robot = one.vsnbench("robots", "simulate", tmp_path / "small.yaml")
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)
        yield one


def started(graph: Graph2, model: str) -> Process:
    """Start a trial in the directory of the settings file."""
    words = ("--robot", graph.directory / "small.yaml", "--model", model, "--goal", "sofa", "--starts", "8")
    command = [sys.executable, "-m", "vsnbench.cli.main", "run", *map(str, words)]
    results = ("--results", str(graph.directory / "results"))
    return graph.launch(["env", "-C", str(graph.directory), *command, *results], {})


def opened(run: Process) -> Browser:
    """Return the browser of the driver, once the page is there."""
    wait_until(lambda: re.search(r"http://\S+token=\S+", run.output) or run.popen.poll() is not None, "the page", 120)
    found = re.search(r"http://\S+token=\S+", run.output)
    assert found is not None, run.output
    browser = Browser(found[0]).enter()
    browser.csrf_token = browser.ask("GET", "/state").json["csrf_token"]
    return browser


def test_a_person_drives_up_to_what_the_guard_refuses(graph: Graph2) -> None:
    run = started(graph, "human:ada")
    ada = opened(run)
    state = {}

    def is_asked(*phases: str) -> bool:
        state.update(ada.ask("GET", "/state").json)
        return state["phase"] in phases or run.popen.poll() is not None

    wait_until(lambda: is_asked("ready"), "the trial is offered", 120)
    assert ada.post("/take").status == 200
    refusals = []
    for action in [*LONGEST_WAY * ["MOVE_FORWARD"], "TURN_LEFT", "STOP"]:
        if refusals and refusals[-1] and action == "MOVE_FORWARD":
            continue
        wait_until(lambda: is_asked("choosing"), "the next picture", 120)
        assert state["phase"] == "choosing", run.output
        refusals.append(state["refused"])
        if state["refused"] and action == "MOVE_FORWARD":
            continue
        assert ada.ask("GET", "/picture").body.startswith(b"\xff\xd8")
        assert ada.post("/choose", picture=state["picture"], action=action).status == 200
    assert run.wait(120) == 0, run.output
    with sqlite3.connect(graph.directory / "results" / "vsnbench.db") as connection:
        steps = connection.execute("select action, blocked, collision_touched from step order by number").fetchall()
        ((reason, driver),) = connection.execute(
            "select verdict.end_reason, json_extract(model.settings, '$.driver') from verdict "
            "join episode on episode.id = episode_id join trial on trial.id = trial_id "
            "join campaign on campaign.id = trial.campaign_id join model on model.id = model_id"
        )
    assert [action for action, *_ in steps[-3:]] == ["MOVE_FORWARD", "TURN_LEFT", "STOP"]
    assert [bool(blocked) for _, blocked, _ in steps] == [*((len(steps) - 3) * [False]), True, False, False]
    assert not any(touched for *_, touched in steps), "the guard keeps the robot from what is ahead"
    assert refusals[-2:] == [True, False]
    assert (reason, driver) == ("stop", "ada")
