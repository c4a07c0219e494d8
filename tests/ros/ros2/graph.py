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
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.processes import Process, ProcessGroup, wait_until
from tests.robots.client import Client
from tests.two_machines import TwoMachines
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.watchdog import WatchdogMeasurement, store_measurement

HERE = Path(__file__).parent
PROFILE = HERE / "profile_of_test_base.yaml"
_FAST_DDS = "rmw_fastrtps_cpp"


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
    shares_memory: bool = False
    """Whether processes share memory, which full-size images need.

    With shared memory, the default of Fast DDS on one machine, a killed process may leave a lock for which the others
    wait for up to 2 s. A robot and its workstation are two machines, without shared memory between them, so a graph of
    tests uses the network interface.
    """
    machines: TwoMachines | None = None
    """The robot's machine, on which processes start, and the workstation; None for one machine."""
    packages: Path | None = None
    """Directory of the packages of interfaces that were built for a test."""

    @property
    def environment(self) -> dict[str, str]:
        if self.machines is not None:
            reach = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
        elif self.shares_memory or os.environ.get("RMW_IMPLEMENTATION", _FAST_DDS) != _FAST_DDS:
            reach = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        else:
            settings = str(HERE / "loopback.xml")
            reach = {
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
                "FASTDDS_DEFAULT_PROFILES_FILE": settings,
                "FASTRTPS_DEFAULT_PROFILES_FILE": settings,  # the name before Fast DDS 3
            }
        return {
            **os.environ,
            **reach,
            "ROS_DOMAIN_ID": str(self.domain.number),
            "ROS_LOG_DIR": str(self.directory),
            "XDG_STATE_HOME": str(self.directory / "state"),
            "PYTHONPATH": os.pathsep.join(
                [
                    *(str(HERE.parents[2]), str(HERE / "stand_ins"), os.environ.get("PYTHONPATH", "")),
                    *([] if self.packages is None else [str(self.packages)]),
                ]
            ),
            "PYTHONUNBUFFERED": "1",
        }

    def start(self, *words: str | Path, **environment: str) -> Process:
        """Start a Python file or module in this graph, with an open stdin."""
        return self.launch([sys.executable, *map(str, words)], environment, subprocess.PIPE)

    def run(self, *words: str | Path, **environment: str) -> Process:
        """Start `vsnbench run` on the workstation, which may be this machine."""
        command = [sys.executable, "-m", "vsnbench.cli.main", "run", *map(str, words)]
        inside = () if self.machines is None else self.machines.on_workstation
        return self.launch([*inside, *command], environment)

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
    """Return a directory of XDG_STATE_HOME with a passed measurement of the watchdog of the tests' base.

    tests/ros/ros2/test_doctor.py measures one.
    """
    directory = Path(mkdtemp(prefix="watchdog"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    profile = load_profile(str(PROFILE))
    passed = WatchdogMeasurement(
        robot=profile.name, stated_s=0.5, allowed_s=0.9, stopped_s=0.5, measured_at=datetime.now(UTC)
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(directory))
        store_measurement(passed, profile, simulated=False)
    return directory


@contextmanager
def live_graph(
    directory: Path, *, shares_memory: bool = False, machines: TwoMachines | None = None, packages: Path | None = None
) -> Iterator[Graph2]:
    graph = Graph2(directory, shares_memory=shares_memory, machines=machines, packages=packages)
    try:
        yield graph
    finally:
        graph.close()


def start_discrete_move(graph: Graph2) -> Process:
    node = graph.vsnbench("robots", "serve", PROFILE)
    wait_until(lambda: "executing movements" in node.output, "discrete_move is up")
    return node
