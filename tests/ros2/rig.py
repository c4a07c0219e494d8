"""A robot over ROS 2 whose parts can fail, and its client; every test finds it in the same state."""

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.processes import PATIENCE_S, Process, wait_until
from tests.robots.client import Client, can
from tests.robots.fault_table import WITH_DOCTOR, Attempt, FaultTable, attempt, complaints, doctor_text
from tests.ros2.graph import (
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

STOPS_WITHIN_S = 5.0
"""Limit from a fault to rest on a live graph, for a base that never stops by itself.

A busy machine may delay any process by a second, so the limits of the rules themselves are tested in virtual time
(tests/sensing/test_mover_faults.py); docs/robot-faults.md has measured times.
"""
NEVER_S = 1000.0
"""Command timeout of a base that does not stop by itself."""
_ATTEMPTS = 4
_OVERLOADED = ("the control loop paused", "no odometry for", "no depth image for", "the caller has disconnected")
"""Reasons for which a busy machine ends a movement, rightly: a run repeats the trial, and a test the movement."""


@dataclass(frozen=True)
class Ending:
    """End of a movement during which a fault happened; times in seconds since the fault."""

    result: dict[str, Any]
    zeroed_s: float | None
    stood_s: float

    @property
    def why(self) -> str:
        return str(self.result["failure"] or self.result["blocked"])


@dataclass
class Rig2:
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
        """Bring every part to a known state: it runs, without a fault, at rest, in a new episode.

        Called before each test, which then inherits nothing, however an earlier one ended.
        """
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

    def moving(self, *request: Any) -> "Future[Any]":
        """Request a movement of the client, and return once the base moves."""
        for _ in range(_ATTEMPTS):
            future = self.client.later(*request)
            wait_until(lambda one=future: moves(self.robot) or one.done(), "the base moves")
            if not future.done():
                return future
            ended = future.result()
            assert _is_overload(ended), ended
            self.make_good()
        raise AssertionError(f"{_ATTEMPTS} movements did not start: {ended}")

    def end_by(self, fault: Callable[[], float], says: str, *request: Any) -> Ending:
        """Return how a movement ends by a fault, whose reason contains `says`.

        Args:
            fault: causes the fault, and returns its time.
            says: part of the reason.
            request: method of the client and its arguments.
        """
        for _ in range(_ATTEMPTS):
            future = self.moving(*request)
            fault_s = fault()
            stood_s = self.stood_after(fault_s)
            result = future.result(PATIENCE_S)
            ending = Ending(result, self.zeroed_after(fault_s), stood_s)
            if says in ending.why or not _is_overload(result):
                return ending
            self.make_good()
        raise AssertionError(f"{_ATTEMPTS} movements ended for another reason: {ending.why}")

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


def _is_overload(result: dict[str, Any]) -> bool:
    return str(result["failure"] or result["blocked"]).startswith(_OVERLOADED)


@contextmanager
def live_rig(directory: Path, *, next_to_base: bool) -> Iterator[Rig2]:
    """A robot steered by this machine, or by a node next to its base."""
    with live_graph(directory) as graph:
        rig = Rig2(graph, next_to_base)
        rig.examine_healthy()
        try:
            yield rig
        finally:
            rig.table.write()
            rig.client.close()
