"""Runs of a robot that drives on over ROS, and what ends them: a lost model, a cut network, STOP on the page."""

import re
import signal
import sqlite3
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.models.remote.servers import stub_server
from tests.processes import Process, wait_until
from tests.two_machines import TwoMachines
from tests.web.browser import Browser
from tests.web.tcp_relay import TcpRelay
from vsnbench.sensing.path_orders import SILENT_S

ONWARD = """
import pathlib
import time

class Model:
    card = {"name": "onward", "sensors": ["odometry"], "action_kinds": ["waypoint"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        while pathlib.Path("hangs").exists():
            time.sleep(0.1)
        return {"movement": {"kind": "waypoint", "x_m": 1.0, "y_m": 0.0}}
"""
ACT_TIMEOUT_S = 4.0
_PATH_S = 1.0 / 0.3 + 1.0
"""Time for the path of the last answer, with its acceleration: the robot drives to its end."""
SLACK_S = 4.0
"""A busy machine may delay several processes by a second each; a robot that is not stopped drives for minutes."""


@dataclass(frozen=True)
class Loss:
    """A way to lose the model, the words of the episode's end, and the longest time until the robot rests."""

    says: str
    rests_within_s: float


LATE_S = 5.0
"""Time in which TCP sends again what was lost while the network was cut."""
AT_ONCE_S = 1.0
"""Time to brake from 0.3 m/s, without the slack."""
LOSSES = {
    "killed": Loss("act: the connection to ws:", AT_ONCE_S),
    "hangs": Loss("within 4 s", _PATH_S),
    "stopped": Loss("within 4 s", _PATH_S),
    "connection cut": Loss("act: the connection to ws:", AT_ONCE_S),
    "network silent": Loss("within 4 s", _PATH_S),
}
LOSSES_OF_TESTS = [pytest.param(name, marks=[] if name == "killed" else pytest.mark.long) for name in LOSSES]
"""One in `make test`: the others differ in what the client sees, which tests/models/remote/test_policy.py has."""


@dataclass
class ServedModel:
    """A model in a process of its own, behind a relay."""

    directory: Path
    relay: TcpRelay
    process: "subprocess.Popen[bytes]"

    @property
    def options(self) -> tuple[str, ...]:
        """Options of a run with this model."""
        settings = self.directory / "wire.yaml"
        settings.write_text(f"act_timeout_s: {ACT_TIMEOUT_S}\npatience_s: 1\n")
        return "--model", f"ws://127.0.0.1:{self.relay.port}", "--model-config", str(settings)

    def lose(self, how: str) -> float:
        """Lose the model, and return the time."""
        if how == "killed":
            self.process.kill()
        elif how == "hangs":
            (self.directory / "hangs").touch()
        elif how == "stopped":
            self.process.send_signal(signal.SIGSTOP)
        elif how == "connection cut":
            self.relay.mend(cut=True)
        else:
            self.relay.stall()
        return time.monotonic()


@contextmanager
def served_model(directory: Path) -> Iterator[ServedModel]:
    with stub_server(ONWARD, directory) as (url, process), TcpRelay(urlsplit(url).port or 0) as relay:
        yield ServedModel(directory, relay, process)


class DrivenRobot(ABC):
    """A robot of the tests with nothing in its way, whose base never stops by itself."""

    @abstractmethod
    def run(self, *words: str) -> Process:
        """Start `vsnbench run` on the workstation."""

    @property
    @abstractmethod
    def base_moves(self) -> bool:
        """Whether the base truly moves."""

    @abstractmethod
    def stood_after(self, since_s: float) -> float:
        """Wait until the base is at rest; return the time from then until it was."""

    @abstractmethod
    def zeroed_after(self, since_s: float) -> float:
        """Wait until zero velocity is commanded for good; return the time from then until it was."""

    def drive_on(self, results: Path, *words: str) -> Process:
        """Start a run, and return once the robot has driven on for a second."""
        trial = ("--goal", "chair", "--starts", "1", "--continuous", "0.3", "--results", str(results))
        run = self.run(*trial, *words)
        self.await_driving(run)
        return run

    def await_driving(self, run: Process) -> None:
        """Wait until the robot has driven on for a second."""
        wait_until(lambda: self.base_moves or run.popen.poll() is not None, "the robot moves", 120.0)
        began_s = time.monotonic()
        wait_until(lambda: time.monotonic() - began_s > 1.0, "it drives on")
        assert self.base_moves, run.output

    def times_after(self, what: str, since_s: float) -> tuple[float, float]:
        """Return the times to the last zero velocity and to rest, and print them."""
        times = self.zeroed_after(since_s), self.stood_after(since_s)
        sys.stdout.write(f"driving on: {what}: zero after {times[0]:.3f} s, at rest after {times[1]:.3f} s\n")
        return times


def check_lost_model(robot: DrivenRobot, how: str, directory: Path, *words: str) -> None:
    """Lose the model of a robot that drives on: it comes to rest, and the episode ends for the reason."""
    loss, results = LOSSES[how], directory / "results"
    with served_model(directory) as model:
        run = robot.drive_on(results, *model.options, *words)
        lost_s = model.lose(how)
        assert max(robot.times_after(f"model {how}", lost_s)) < loss.rests_within_s + SLACK_S
        check_end(run, results, "model_lost", loss.says)
        model.process.send_signal(signal.SIGCONT)


def check_cut_network(robot: DrivenRobot, machines: TwoMachines, directory: Path, *words: str) -> None:
    """Cut the network between the workstation and a robot that drives on; nothing is driven once it is mended."""
    results = directory / "results"
    run = robot.drive_on(results, "--model", "tests.robots.onward:Onward", *words)
    cut_s = time.monotonic()
    machines.cut()
    stood_s = robot.stood_after(cut_s)
    sys.stdout.write(f"driving on: network cut: at rest after {stood_s:.3f} s\n")
    assert stood_s < SILENT_S + AT_ONCE_S + SLACK_S
    check_end(run, results, "sensor_lost", "the robot is silent")
    machines.mend()
    mended_s = time.monotonic()
    wait_until(lambda: robot.base_moves or time.monotonic() - mended_s > LATE_S, "late messages could arrive")
    assert not robot.base_moves


def check_stop_on_page(robot: DrivenRobot, results: Path, *words: str) -> None:
    """Press STOP on the page while the robot drives on."""
    run = robot.run(
        *("--model", "tests.robots.onward:Onward", "--goal", "chair", "--starts", "1", "--continuous", "0.3"),
        *("--console=:0", "--results", str(results), *words),
    )
    anna = signed_in(run)
    wait_until(lambda: (anna.ask("GET", "/state").json["question"] or {}).get("kind") == "place", "it asks to place")
    question = anna.ask("GET", "/state").json["question"]["number"]
    assert anna.post("/answer", question=question, answer="go").status == 200
    robot.await_driving(run)
    pressed_s = time.monotonic()
    assert anna.post("/stop").status == 200
    # A robot that is not stopped drives for minutes; benchmarks/stop_from_page.py measures the milliseconds.
    assert max(robot.times_after("STOP on the page", pressed_s)) < SLACK_S
    wait_until(lambda: ends_of(results), "the episode has ended")
    run.signal(signal.SIGTERM)
    run.wait()
    (end,) = ends_of(results)
    assert end[0] == "aborted"
    assert "STOP" in end[1]
    assert "Anna" in end[1]


def signed_in(run: Process) -> Browser:
    """Return the browser of an operator who has opened the page of a run."""

    def address() -> "re.Match[str] | None":
        assert run.popen.poll() is None, run.output
        return re.search(r"http://\S+token=\S+", run.output)

    wait_until(address, "the run logs the page's address")
    found = address()
    assert found is not None
    anna = Browser(found[0]).enter()
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    anna.cookie = anna.post("/sign-in", name="Anna").headers["set-cookie"].partition(";")[0]
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    return anna


def ends_of(results: Path) -> list[tuple[str, str]]:
    """Return reason and error of the episodes that have ended."""
    with sqlite3.connect(results / "vsnbench.db") as connection:
        return connection.execute("select end_reason, error from episode where end_reason is not null").fetchall()


def check_end(run: Process, results: Path, reason: str, *says: str) -> None:
    """Check how the only episode of a run ended, in the record and at the terminal."""
    assert run.wait(120) == 1, run.output
    ((ended, error),) = ends_of(results)
    sys.stdout.write(f"{ended}: {error}\n")
    assert ended == reason
    assert any(words in error for words in says), error
    assert error in run.output
    with sqlite3.connect(results / "vsnbench.db") as connection:
        ((steps,),) = connection.execute("select count(*) from step")
    assert steps > 2, "the answers before are recorded"
