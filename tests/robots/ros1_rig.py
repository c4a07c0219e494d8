"""A robot of parts that can fail one by one, and its client, each a process of its own on a real ROS master."""

import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.robots.client import Client
from tests.ros1.network import HERE, PYTHON_OF_ROS1, Probe, Process, RosNetwork, live_network, wait_until

PROFILE = HERE / "profile_of_test_base.yaml"


def client_of(network: RosNetwork, patience_s: float = 6.0) -> Client:
    """A RosRobot in a process of its own."""
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

    def start_server(self) -> None:
        self.server = start_server(self.network)

    def restart_client(self, patience_s: float = 6.0) -> None:
        self.client.close()
        self.client = client_of(self.network, patience_s)

    def fault(self, part: str, word: str) -> float:
        return self.probe.tell(f"/{part}/fault", word)

    def moving(self, action: str) -> "Future[Any]":
        """Ask for an action, and return once the base is really moving."""
        future = self.client.later("execute", action)
        wait_until(lambda: self.probe.speed > 0.05 or future.done(), "the base moves")
        return future

    def put_right(self) -> None:
        """End every fault, and wait until the base stands."""
        self.client("halt")
        for part, words in (("base", ("good", "release", "floor", "raise")), ("camera", ("good",))):
            for word in words:
                self.fault(part, word)
        began_s = time.monotonic()
        wait_until(lambda: self.probe.stopped_at(began_s) is not None, "the base stands still after the test")

    def stands_still_within(self, limit_s: float, since_s: float) -> bool:
        wait_until(lambda: self.probe.stopped_at(since_s) is not None, "the base stands still")
        took_s = self.probe.stopped_at(since_s) - since_s
        sys.stdout.write(f"stood still {took_s:.2f} s after the fault\n")
        return took_s < limit_s


def start_server(network: RosNetwork) -> Process:
    server = network.start("-m", "vsnbench.cli.main", "ros", "discrete-move", "--robot", str(PROFILE))
    network.wait_for_service("/discrete_move")
    return server


@contextmanager
def live_rig(directory: Path) -> Iterator[Rig]:
    """A robot whose base never stops by itself: whatever stands still was told to."""
    with live_network(directory) as network:
        base = network.start(HERE / "nodes" / "kinematic_base.py", "_heading_deg:=-72", "_command_timeout_s:=1000")
        camera = network.start(HERE / "nodes" / "camera.py")
        server = start_server(network)
        client, probe = client_of(network), Probe(network)
        rig = Rig(network, probe, base, camera, server, client)
        try:
            yield rig
        finally:
            rig.client.close()
            probe.close()
            sys.stdout.write(f"--- the client\n{(network.directory / 'client.log').read_text()}\n")
