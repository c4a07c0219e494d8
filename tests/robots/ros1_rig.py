"""A robot whose parts can fail one by one, and its client, as processes on a real ROS master."""

import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.robots.client import Client
from tests.robots.fault_table import WITH_DOCTOR, Attempt, FaultRow, FaultTable, attempt, complaints, doctor_text
from tests.ros1.network import HERE, PYTHON_OF_ROS1, Probe, Process, RosNetwork, live_network, wait_until

PROFILE = HERE / "profile_of_test_base.yaml"


def client_of(network: RosNetwork, patience_s: float = 6.0) -> Client:
    """A RosRobot in a separate process."""
    return Client(network, PYTHON_OF_ROS1, PROFILE, patience_s)


@dataclass
class Rig:
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

    def fault(self, part: str, word: str) -> float:
        return self.probe.tell(f"/{part}/fault", word)

    def moving(self, action: str) -> "Future[Any]":
        """Request an action, and return once the base truly moves."""
        future = self.client.later("execute", action)
        wait_until(lambda: self.probe.speed > 0.05 or future.done(), "the base moves")
        return future

    def put_right(self) -> None:
        """End every fault, and wait until the base is at rest."""
        self.client("halt")
        for part, words in (("base", ("good", "release", "floor", "raise")), ("camera", ("good",))):
            for word in words:
                self.fault(part, word)
        began_s = time.monotonic()
        wait_until(lambda: self.probe.stopped_at(began_s) is not None, "the base stands still after the test")

    def stands_still_within(self, limit_s: float, since_s: float) -> bool:
        return self.rest_s(since_s) < limit_s

    def rest_s(self, since_s: float) -> float:
        """Return the time from a fault to the base's rest for good."""
        wait_until(lambda: self.probe.stopped_at(since_s) is not None, "the base stands still")
        return float(self.probe.stopped_at(since_s)) - since_s

    def zero_s(self, since_s: float) -> float:
        """Return the time from a fault to the first of the zero velocities that the base receives for good."""
        wait_until(lambda: self.probe.zeroed_at(since_s) is not None, "zero velocity is commanded")
        return float(self.probe.zeroed_at(since_s)) - since_s

    def second(self, name: str, *arguments: Any) -> Attempt:
        """Request another movement."""
        return attempt(self.client, lambda: self.probe.pose, name, *arguments)

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

    def times(self, since_s: float) -> tuple[float, float]:
        """Return the times from a fault to zero velocity and to rest, before the next request."""
        return self.zero_s(since_s), self.rest_s(since_s)

    def row(
        self,
        cause: str,
        result: dict[str, Any],
        times: tuple[float, float] | tuple[None, None],
        doctor: str,
        second: Attempt | str,
    ) -> None:
        """Add a row; a base at rest has no times."""
        why = result["failure"] or result.get("blocked", "")
        self.table.rows.append(FaultRow(cause, *times, result["end_reason"], why, doctor, str(second)))


def start_server(network: RosNetwork) -> Process:
    server = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE))
    network.wait_for_service("/discrete_move")
    return server


@contextmanager
def live_rig(directory: Path) -> Iterator[Rig]:
    """A robot whose base only stops on command."""
    with live_network(directory) as network:
        base = network.start(HERE / "nodes" / "kinematic_base.py", "_heading_deg:=-72", "_command_timeout_s:=1000")
        camera = network.start(HERE / "nodes" / "camera.py")
        server = start_server(network)
        client, probe = client_of(network), Probe(network)
        rig = Rig(network, probe, base, camera, server, client)
        rig.examine_healthy()
        try:
            yield rig
        finally:
            rig.table.write()
            rig.client.close()
            probe.close()
            sys.stdout.write(f"--- the client\n{(network.directory / 'client.log').read_text()}\n")
