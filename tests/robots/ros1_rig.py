"""A robot of parts that can fail one by one, and its client, each a process of its own on a real ROS master."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.ros1.network import HERE, PYTHON_OF_ROS1, Probe, Process, RosNetwork, live_network, wait_until

PROFILE = HERE / "profile_of_test_base.yaml"


class ClientError(Exception):
    """What the robot raised in the client's process."""


class Client:
    """A RosRobot in a process of its own."""

    def __init__(self, network: RosNetwork, profile: Path = PROFILE, patience_s: float = 6.0) -> None:
        self.errors = (network.directory / "client.log").open("ab")
        self.popen = subprocess.Popen(
            [*PYTHON_OF_ROS1, str(HERE / "nodes" / "client.py"), str(profile), str(patience_s)],
            env=network.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            text=True,
        )
        assert json.loads(self.popen.stdout.readline()) == "ready"

    def __call__(self, name: str, *arguments: Any) -> Any:
        self.popen.stdin.write(json.dumps([name, *arguments]) + "\n")
        self.popen.stdin.flush()
        answer = json.loads(self.popen.stdout.readline())
        if "error" in answer:
            raise ClientError(f"{answer['error']}: {answer['message']}")
        return answer["answer"]

    def later(self, name: str, *arguments: Any) -> "Future[Any]":
        pool = ThreadPoolExecutor(1)
        future = pool.submit(self, name, *arguments)
        pool.shutdown(wait=False)
        return future

    def close(self) -> None:
        self.popen.kill()
        self.popen.wait()
        for pipe in (self.popen.stdin, self.popen.stdout, self.errors):
            pipe.close()


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
        self.client = Client(self.network, patience_s=patience_s)

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


def can(action: Callable[[], object]) -> bool:
    try:
        action()
    except ClientError:
        return False
    return True


@contextmanager
def live_rig(directory: Path) -> Iterator[Rig]:
    """A robot whose base never stops by itself: whatever stands still was told to."""
    with live_network(directory) as network:
        base = network.start(HERE / "nodes" / "kinematic_base.py", "_heading_deg:=-72", "_command_timeout_s:=1000")
        camera = network.start(HERE / "nodes" / "camera.py")
        server = start_server(network)
        client, probe = Client(network), Probe(network)
        rig = Rig(network, probe, base, camera, server, client)
        try:
            yield rig
        finally:
            rig.client.close()
            probe.close()
            sys.stdout.write(f"--- the client\n{(network.directory / 'client.log').read_text()}\n")
