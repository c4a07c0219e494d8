"""A robot whose parts can fail one by one, and its client, as processes on a real ROS master."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.robots.client import Client, can
from tests.robots.fault_table import WITH_DOCTOR, Attempt, FaultRow, FaultTable, complaints, doctor_text
from tests.robots.faulty_rig import FaultyRig
from tests.ros.ros1.network import HERE, PYTHON_OF_ROS1, Probe, Process, RosNetwork, live_network, wait_until

PROFILE = HERE / "profile_of_test_base.yaml"
_MOVES = 0.05
"""A base with a higher speed, |m/s| + |rad/s|, moves."""


def client_of(network: RosNetwork, patience_s: float = 6.0) -> Client:
    """A RosRobot in a separate process."""
    return Client(network, PYTHON_OF_ROS1, PROFILE, patience_s)


@dataclass
class Rig(FaultyRig):
    """A robot of parts that can fail one by one, and its client."""

    network: RosNetwork
    probe: Probe
    base: Process
    camera: Process
    server: Process
    client: Client
    table: FaultTable = field(default_factory=lambda: FaultTable("ROS 1"))
    healthy: frozenset[str] = frozenset()
    """Checks of `doctor` that are not ok of the healthy robot."""

    def start_server(self) -> None:
        self.server = start_server(self.network)

    def restart_client(self, patience_s: float = 6.0) -> None:
        self.client.close()
        self.client = client_of(self.network, patience_s)

    def signalled(self, number: signal.Signals) -> float:
        """Signal the server, and return the time."""
        self.server.signal(number)
        return time.monotonic()

    def fault(self, part: str, word: str) -> float:
        """Cause a fault, and return its time."""
        return self.probe.tell(f"/{part}/fault", word)

    @property
    def base_moves(self) -> bool:
        return self.probe.speed > _MOVES

    @property
    def true_pose(self) -> tuple[float, float, float]:
        return self.probe.pose

    def make_good(self) -> None:
        for process in (self.base, self.camera, self.server, self.client):
            process.popen.send_signal(signal.SIGCONT)  # does nothing to a process that has ended
        if self.base.popen.poll() is not None:
            self.base = start_base(self.network)
        if self.camera.popen.poll() is not None:
            self.camera = start_camera(self.network)
        if self.server.popen.poll() is not None:
            self.start_server()
        for part, words in (("base", ("good", "release", "floor", "raise")), ("camera", ("good",))):
            for word in words:
                self.fault(part, word)
        if not self.client.is_ready:
            self.restart_client()
        self.client("halt")
        began_s = time.monotonic()
        wait_until(lambda: self.probe.stopped_at(began_s) is not None, "the base stands still before the test")
        if not can(lambda: self.client("begin")):
            self.restart_client()  # a client does not continue with another server
            wait_until(lambda: can(lambda: self.client("begin")), "an episode begins", 60.0)

    def stood_after(self, fault_s: float) -> float:
        wait_until(lambda: self.probe.stopped_at(fault_s) is not None, "the base stands still")
        return float(self.probe.stopped_at(fault_s)) - fault_s

    def zeroed_after(self, fault_s: float) -> float:
        """Return the time from a fault to the first of the zero velocities that the base receives for good."""
        wait_until(lambda: self.probe.zeroed_at(fault_s) is not None, "zero velocity is commanded")
        return float(self.probe.zeroed_at(fault_s)) - fault_s

    def doctor(self, *words: str) -> str:
        """Return the findings of `doctor`, if the table is measured."""
        return doctor_text(self._complaints(*words)) if WITH_DOCTOR else "–"

    def _complaints(self, *words: str) -> dict[str, str]:
        where = ["--robot", str(PROFILE), "--results", str(self.network.directory / "results"), "--json"]
        return complaints(self.network.start("-m", "vsnbench.cli.main", "doctor", *where, *words), self.healthy)

    def examine_healthy(self) -> None:
        """Store the findings of `doctor` about the healthy robot."""
        if WITH_DOCTOR:
            self.healthy = frozenset(self._complaints())

    def row(
        self,
        cause: str,
        result: dict[str, Any],
        times: tuple[float | None, float | None],
        doctor: str,
        second: Attempt | str,
    ) -> None:
        """Add a row; a base at rest has no times."""
        why = result["failure"] or result.get("blocked", "")
        self.table.rows.append(FaultRow(cause, *times, result["end_reason"], why, doctor, str(second)))


def start_base(network: RosNetwork) -> Process:
    """Start a base that only stops on command."""
    return network.start(HERE / "nodes" / "kinematic_base.py", "_heading_deg:=-72", "_command_timeout_s:=1000")


def start_camera(network: RosNetwork) -> Process:
    return network.start(HERE / "nodes" / "camera.py")


def start_server(network: RosNetwork) -> Process:
    server = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE))
    network.wait_for_service("/discrete_move")
    return server


@contextmanager
def live_rig(directory: Path) -> Iterator[Rig]:
    """A robot whose base only stops on command."""
    with live_network(directory) as network:
        base, camera = start_base(network), start_camera(network)
        server = start_server(network)
        client, probe = client_of(network), Probe(network)
        rig = Rig(network, probe, base, camera, server, client)
        try:
            rig.examine_healthy()
            yield rig
        finally:
            rig.table.write()
            rig.client.close()
            probe.close()
            sys.stdout.write(f"--- the client\n{(network.directory / 'client.log').read_text()}\n")
