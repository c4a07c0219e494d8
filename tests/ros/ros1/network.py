"""A ROS master and nodes as processes that end with the test."""

import json
import os
import shutil
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.processes import PATIENCE_S, Conversation, Process, ProcessGroup, wait_until
from tests.two_machines import ROBOT_ADDRESS, WORKSTATION_ADDRESS, TwoMachines
from vsnbench.ros.ros1.master import Master, MasterError

ROSMASTER = shutil.which("rosmaster", path=f"{sys.prefix}/bin:/usr/bin") or "rosmaster: run scripts/install_ros.sh"
HERE = Path(__file__).parent
PYTHON_OF_ROS1 = (sys.executable, str(HERE / "speak_ros1.py"))
"""Program that runs a Python file with ROS 1, even if ROS 2 has packages of the same names."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class RosNetwork(ProcessGroup):
    """A ROS network: a master on a free port, and its nodes.

    It is on the loopback interface, or on the robot's of two machines.
    """

    port: int = field(default_factory=free_port)
    roscore: Process | None = None
    machines: TwoMachines | None = None

    @property
    def host(self) -> str:
        return "127.0.0.1" if self.machines is None else ROBOT_ADDRESS

    @property
    def uri(self) -> str:
        return f"http://{self.host}:{self.port}"

    @property
    def master(self) -> Master:
        return Master(self.uri)

    @property
    def environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": self.host,
            "ROS_HOME": str(self.directory),
            "ROS_LOG_DIR": str(self.directory / "log"),
            "PYTHONPATH": os.pathsep.join([str(HERE.parents[2]), os.environ.get("PYTHONPATH", "")]),
            "PYTHONUNBUFFERED": "1",
        }

    def start(self, *command: str | Path, python: bool = True, **environment: str) -> Process:
        """Start a Python file, module (`-m`, name) or program on this network."""
        words = list(map(str, command))
        if python:
            words = [sys.executable, *words] if words[0] == "-m" else [*PYTHON_OF_ROS1, *words]
        return self.launch(words, environment)

    def run(self, *words: str | Path) -> Process:
        """Start `vsnbench run` on the workstation, which may be this machine."""
        command = [sys.executable, "-m", "vsnbench.cli.main", "run", *map(str, words)]
        if self.machines is None:
            return self.launch(command, {})
        return self.launch([*self.machines.on_workstation, *command], {"ROS_IP": WORKSTATION_ADDRESS})

    def start_master(self) -> Process:
        self.roscore = self.start(ROSMASTER, "--core", "-p", str(self.port))
        pid = self.roscore.popen.pid

        def answers() -> bool:
            try:
                return self.master.pid() == pid
            except MasterError:
                return False

        wait_until(answers, f"the master answers at {self.uri}")
        return self.roscore

    def wait_for_service(self, name: str, patience_s: float = PATIENCE_S) -> None:
        wait_until(lambda: name in self.master.state().services, f"service {name} is offered", patience_s)

    def wait_for_publisher(self, topic: str, patience_s: float = PATIENCE_S) -> None:
        wait_until(lambda: topic in self.master.state().publishers, f"topic {topic} is published", patience_s)


class Probe:
    """A ROS node in a separate process, controlled by lines of JSON."""

    def __init__(self, network: RosNetwork) -> None:
        self._node = Conversation([*PYTHON_OF_ROS1, str(HERE / "nodes" / "probe.py")], network.environment)
        self.ask("ready")

    def ask(self, word: str, *arguments: Any) -> Any:
        """Send a request to the node and return its answer."""
        return json.loads(self._node.tell(json.dumps([word, *arguments])))

    def tell(self, topic: str, word: str) -> float:
        """Publish a std_msgs/String on a topic, and return the time (monotonic clock)."""
        self.ask("connect", topic)
        return float(self.ask("publish", topic, word))

    @property
    def speed(self) -> float:
        """Current true speed of the base: |m/s| + |rad/s|."""
        return float(self.ask("truth")["speed"])

    @property
    def heading_deg(self) -> float:
        return float(self.ask("truth")["heading_deg"])

    @property
    def position(self) -> tuple[float, float]:
        truth = self.ask("truth")
        return truth["x_m"], truth["y_m"]

    @property
    def pose(self) -> tuple[float, float, float]:
        """True pose of the base, metres and degrees."""
        truth = self.ask("truth")
        return truth["x_m"], truth["y_m"], truth["heading_deg"]

    def stopped_at(self, since_s: float) -> float | None:
        """Return when the base finally came to rest after `since_s` (monotonic clock), None while it moves."""
        when = self.ask("stopped_since", since_s, "speed")
        return None if when is None else float(when)

    def zeroed_at(self, since_s: float) -> float | None:
        """Return when the last motion command after `since_s` was followed by zero, None before that."""
        when = self.ask("stopped_since", since_s, "commanded")
        return None if when is None else float(when)

    def close(self) -> None:
        self._node.close()


@contextmanager
def live_network(directory: Path, machines: TwoMachines | None = None) -> Iterator[RosNetwork]:
    """Yield a ROS network with a running master; afterwards end its nodes and print their output."""
    ros = RosNetwork(directory, machines=machines)
    try:
        ros.start_master()
        yield ros
    finally:
        ros.close()
