"""A ROS 2 graph on the loopback interface: processes, and a robot whose parts can fail."""

import atexit
import math
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from tests.processes import Process, ProcessGroup, wait_until
from tests.robots.client import Client
from tests.robots.fault_table import WITH_DOCTOR, Attempt, FaultTable, attempt, complaints, doctor_text

HERE = Path(__file__).parent
PROFILE = HERE / "profile_of_test_base.yaml"


def is_bound(to_bind: socket.socket, host: str, port: int) -> bool:
    try:
        to_bind.bind((host, port))
    except OSError:
        return False
    return True


class Domain:
    """An unused ROS 2 domain, reserved until it is released."""

    def __init__(self) -> None:
        for step in range(101):
            self.number = 1 + (os.getpid() + step) % 101
            port = 7410 + 250 * self.number
            self._held = socket.socket()
            # Tests keep one another out by the TCP port; the first participant's is the UDP port.
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                if is_bound(self._held, "127.0.0.1", port) and is_bound(probe, "", port):
                    return
            self._held.close()
        raise AssertionError("every domain is taken")

    def close(self) -> None:
        self._held.close()


@dataclass
class Graph2(ProcessGroup):
    """A graph: a domain and its processes."""

    domain: Domain = field(default_factory=Domain)
    state: Path | None = None
    """Directory of watchdog measurements; default: one for this graph."""

    @property
    def environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "ROS_DOMAIN_ID": str(self.domain.number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(self.directory),
            "XDG_STATE_HOME": str(self.state or self.directory / "state"),
            "PYTHONPATH": os.pathsep.join(
                [
                    *(str(HERE.parent.parent), str(HERE / "stand_ins"), os.environ.get("PYTHONPATH", "")),
                    str(HERE / "tf_stand_in"),  # the last: a sourced distribution has the real package
                ]
            ),
            "PYTHONUNBUFFERED": "1",
        }

    def start(self, *words: str | Path, **environment: str) -> Process:
        """Start a Python file or module in this graph, with an open stdin."""
        return self.launch([sys.executable, *map(str, words)], environment, subprocess.PIPE)

    def vsnbench(self, *words: str | Path, **environment: str) -> Process:
        return self.start("-m", "vsnbench.cli.main", *words, **environment)

    def close(self) -> None:
        super().close()
        self.domain.close()


def send_line(process: Process, words: str) -> float:
    """Send a line to a robot of the tests, and return the time (monotonic clock)."""
    assert process.popen.stdin is not None
    process.popen.stdin.write(f"{words}\n".encode())
    process.popen.stdin.flush()
    return time.monotonic()


def moves(robot: Process) -> bool:
    states = [line.split()[0] for line in robot.output.splitlines() if line.startswith(("moves", "stands"))]
    return bool(states) and states[-1] == "moves"


def stands_since(robot: Process) -> float | None:
    """Return since when the base is at rest, None while it moves."""
    states = [line.split() for line in robot.output.splitlines() if line.startswith(("moves", "stands"))]
    return float(states[-1][1]) if states and states[-1][0] == "stands" else None


def zeroed_since(robot: Process) -> float | None:
    """Return since when the base is commanded zero velocity, None while it is commanded to move."""
    written = [line.split() for line in robot.output.splitlines() if line.startswith(("commanded", "zeroed"))]
    return float(written[-1][1]) if written and written[-1][0] == "zeroed" else None


def true_pose(robot: Process) -> tuple[float, float, float]:
    """Return the true pose of the base: metres and degrees."""
    before = robot.output.count("\nat ")
    send_line(robot, "where")
    wait_until(lambda: robot.output.count("\nat ") > before, "the robot writes where it is")
    x_m, y_m, heading_deg = map(float, robot.output.rsplit("\nat ", 1)[1].split()[:3])
    return x_m, y_m, heading_deg


def is_at(robot: Process, pose: tuple[float, float, float]) -> bool:
    """Return whether the base is where it was, within a millimetre and 0.1 degrees.

    A resumed process may still deliver a command, and the base is held at the next control period.
    """
    x_m, y_m, heading_deg = true_pose(robot)
    turned_deg = math.remainder(heading_deg - pose[2], 360)
    return math.dist((x_m, y_m), pose[:2]) < 0.001 and abs(turned_deg) < 0.1


def client_of(graph: Graph2, profile: Path = PROFILE, patience_s: float = 20.0) -> Client:
    """A RosRobot in a separate process, whose base has a measured watchdog."""
    return Client(graph, (sys.executable,), profile, patience_s, XDG_STATE_HOME=str(measured_watchdog()))


@cache
def measured_watchdog() -> Path:
    """Measure the watchdog of the tests' base with `vsnbench doctor --move`; return its directory."""
    directory = Path(mkdtemp(prefix="watchdog"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    with live_graph(directory) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        send_line(robot, "timeout 0.5")
        doctor = graph.vsnbench("doctor", "--robot", PROFILE, "--move", "--results", directory)
        doctor.wait(120)
        assert "the base stopped" in doctor.output, doctor.output
    return directory / "state"


@dataclass
class Rig2:
    """A robot whose base has no watchdog unless one is set, and its client."""

    graph: Graph2
    robot: Process
    client: Client
    node: Process | None = None
    table: FaultTable = field(default_factory=lambda: FaultTable("ROS 2"))
    healthy: frozenset[str] = frozenset()
    """Checks of `doctor` that are not ok of the healthy robot."""

    def moving(self, action: str) -> "Future[Any]":
        """Request an action, and return once the base moves."""
        future = self.client.later("execute", action)
        wait_until(lambda: moves(self.robot) or future.done(), "the base moves")
        assert not future.done(), future.result()
        return future

    def stood_after(self, fault_s: float) -> float:
        """Return the time from a fault to the base's rest."""
        wait_until(lambda: stands_since(self.robot) is not None, "the base stands")
        return float(stands_since(self.robot)) - fault_s

    def zeroed_after(self, fault_s: float) -> float | None:
        """Return the time from a fault to the final command of zero velocity, None before it."""
        zeroed_s = zeroed_since(self.robot)
        return None if zeroed_s is None else zeroed_s - fault_s

    def second(self, name: str, *arguments: Any) -> Attempt:
        """Request another movement."""
        return attempt(self.client, lambda: true_pose(self.robot), name, *arguments)

    def doctor(self, *words: str) -> str:
        """Return the findings of `doctor`, if the table is measured."""
        return doctor_text(self._complaints(*words)) if WITH_DOCTOR else "–"

    def _complaints(self, *words: str) -> dict[str, str]:
        where = ["--robot", PROFILE, "--results", self.graph.directory / "results", "--json"]
        state = {"XDG_STATE_HOME": str(measured_watchdog())}
        return complaints(self.graph.vsnbench("doctor", *where, *words, **state), self.healthy)

    def examine_healthy(self) -> None:
        """Store the findings of `doctor` about the healthy robot."""
        if WITH_DOCTOR:
            self.healthy = frozenset(self._complaints())

    def put_right(self) -> None:
        for words in ("good", "release"):
            send_line(self.robot, words)
        self.client("halt")


@contextmanager
def live_graph(directory: Path) -> Iterator[Graph2]:
    graph = Graph2(directory)
    try:
        yield graph
    finally:
        graph.close()


def start_discrete_move(graph: Graph2) -> Process:
    node = graph.vsnbench("robots", "serve", PROFILE)
    wait_until(lambda: "executing movements" in node.output, "discrete_move is up")
    return node


@contextmanager
def live_rig(directory: Path, *, next_to_base: bool) -> Iterator[Rig2]:
    """A robot steered by this machine, or next to its base, which then subscribes to TwistStamped."""
    with live_graph(directory) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py", *(["--stamped"] if next_to_base else []))
        node = start_discrete_move(graph) if next_to_base else None
        rig = Rig2(graph, robot, client_of(graph), node)
        rig.table.title = f"ROS 2, {'next to the base' if next_to_base else 'workstation'}"
        rig.examine_healthy()
        try:
            yield rig
        finally:
            rig.table.write()
            rig.client.close()
