"""A robot over ROS 2 whose parts can fail, and its client."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.processes import Process, wait_until
from tests.robots.client import Client, can
from tests.robots.fault_table import WITH_DOCTOR, FaultTable, complaints, doctor_text
from tests.robots.faulty_rig import FaultyRig
from tests.ros.ros2.graph import (
    HERE,
    PROFILE,
    Graph2,
    client_of,
    live_graph,
    measured_watchdog,
    moves,
    send_line,
    stands_since,
    start_discrete_move,
    true_pose,
    zeroed_since,
)

NEVER_S = 1000.0
"""Command timeout of a base that does not stop by itself."""


@dataclass
class Rig2(FaultyRig):
    """A robot whose base has no watchdog unless one is set, and its client."""

    graph: Graph2
    next_to_base: bool
    robot: Process = field(init=False)
    client: Client = field(init=False)
    node: Process | None = None
    table: FaultTable = field(default_factory=lambda: FaultTable("ROS 2"))
    healthy: frozenset[str] = frozenset()
    """Checks of `doctor` that are not ok of the healthy robot."""

    def __post_init__(self) -> None:
        self.table.title = f"ROS 2, {'next to the base' if self.next_to_base else 'workstation'}"
        self._start_robot()
        if self.next_to_base:
            self.node = start_discrete_move(self.graph)
        self.client = client_of(self.graph)

    def _start_robot(self) -> None:
        # Next to its base, the robot subscribes to TwistStamped.
        self.robot = self.graph.start(HERE / "nodes" / "robot.py", *(["--stamped"] if self.next_to_base else []))
        wait_until(lambda: "up" in self.robot.output, "the robot is up")

    def make_good(self) -> None:
        for process in (self.robot, self.node, self.client):
            if process is not None:
                process.popen.send_signal(signal.SIGCONT)  # does nothing to a process that has ended
        if self.robot.popen.poll() is not None:
            self._start_robot()
        for words in ("good", "release", f"timeout {NEVER_S}"):
            send_line(self.robot, words)
        if self.node is not None and self.node.popen.poll() is not None:
            self.node = start_discrete_move(self.graph)
        if not self.client.is_ready:
            self.client.close()
            self.client = client_of(self.graph)
        self.client("halt")
        # A killed client or node stays in the graph until its lease of 20 s has passed.
        wait_until(lambda: can(lambda: self.client("begin")), "an episode begins", 60.0)
        wait_until(lambda: not moves(self.robot), "the base stands before the test")

    @property
    def base_moves(self) -> bool:
        return moves(self.robot)

    @property
    def true_pose(self) -> tuple[float, float, float]:
        return true_pose(self.robot)

    def stood_after(self, fault_s: float) -> float:
        wait_until(lambda: stands_since(self.robot) is not None, "the base stands")
        return float(stands_since(self.robot)) - fault_s

    def zeroed_after(self, fault_s: float) -> float | None:
        zeroed_s = zeroed_since(self.robot)
        return None if zeroed_s is None else zeroed_s - fault_s

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


@contextmanager
def live_rig(directory: Path, *, next_to_base: bool) -> Iterator[Rig2]:
    """A robot steered by this machine, or by a node next to its base."""
    with live_graph(directory) as graph:
        rig = Rig2(graph, next_to_base)
        try:
            rig.examine_healthy()
            yield rig
        finally:
            rig.table.write()
            rig.client.close()
