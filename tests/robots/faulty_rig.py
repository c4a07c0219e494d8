"""A robot over ROS whose parts can fail, and its client; every test finds it in the same state."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from tests.processes import PATIENCE_S, wait_until
from tests.robots.client import Client
from tests.robots.fault_table import Attempt, attempt

STOPS_WITHIN_S = 5.0
"""Limit from a fault to rest on a live graph, for a base that never stops by itself.

A busy machine may delay any process by a second, so the limits of the rules themselves are tested in virtual time
(tests/sensing/test_mover_faults.py); docs/robot-faults.md has measured times.
"""
_ATTEMPTS = 4
_OVERLOADED = (
    *(
        "its machine is overloaded",
        "no odometry",
        "the robot is silent",
        "no depth image",
        "has disconnected",
        "has not steered",
    ),
    "(handshake)",  # the fault came before the movement had begun
)
"""Reasons for which a busy machine ends a movement, rightly: a run repeats the trial, and a test the movement."""


@dataclass(frozen=True)
class Ending:
    """End of a movement during which a fault happened; times in seconds since the fault."""

    result: dict[str, Any]
    zeroed_s: float | None
    """Time to the final command of zero velocity, None for no such command."""
    stood_s: float

    @property
    def why(self) -> str:
        return why_of(self.result)

    @property
    def times(self) -> tuple[float | None, float]:
        return self.zeroed_s, self.stood_s

    def check(self, says: str) -> None:
        """Check that the movement ended for a reason, by a command, in time."""
        assert self.result["completed"] is False
        assert says in self.why
        assert self.zeroed_s is not None
        assert max(self.zeroed_s, self.stood_s) < STOPS_WITHIN_S


def why_of(result: dict[str, Any]) -> str:
    """Return why a movement was not completed, or an empty string."""
    return str(result["failure"] or result["blocked"])


def is_overload(text: str) -> bool:
    """Return whether a movement ended, by its reason, for what a busy machine may cause."""
    return any(words in text for words in _OVERLOADED)


class FaultyRig(ABC):
    """Requests movements of a robot, and causes faults during them."""

    client: Client

    @abstractmethod
    def make_good(self) -> None:
        """Bring every part to a known state: it runs, without a fault, at rest, in a new episode.

        Called before each test, which then inherits nothing, however an earlier one ended.
        """

    @property
    @abstractmethod
    def base_moves(self) -> bool:
        """Whether the base truly moves."""

    @property
    @abstractmethod
    def true_pose(self) -> tuple[float, float, float]:
        """True pose of the base: metres and degrees."""

    @abstractmethod
    def stood_after(self, fault_s: float) -> float:
        """Wait until the base is at rest; return the time from a fault until then."""

    @abstractmethod
    def zeroed_after(self, fault_s: float) -> float | None:
        """Return the time from a fault to the final command of zero velocity, None before it."""

    def undisturbed(self, *request: Any, between: Callable[[], object] = lambda: None) -> dict[str, Any]:
        """Return the result of a movement of the client that no busy machine ended; call `between` before another."""
        for _ in range(_ATTEMPTS):
            result: dict[str, Any] = self.client(*request)
            if not is_overload(why_of(result)):
                return result
            between()
        raise AssertionError(f"{_ATTEMPTS} movements were ended: {result}")

    def moving(self, *request: Any) -> "Future[Any]":
        """Request a movement of the client, and return once the base moves."""
        for _ in range(_ATTEMPTS):
            future = self.client.later(*request)
            wait_until(lambda one=future: self.base_moves or one.done(), "the base moves")
            if not future.done():
                return future
            ended = future.result()
            assert is_overload(why_of(ended)), ended
            self.make_good()
        raise AssertionError(f"{_ATTEMPTS} movements did not start: {ended}")

    def end_by(self, fault: Callable[[], float], says: str, *request: Any) -> Ending:
        """Return how a movement ends by a fault.

        Args:
            fault: causes the fault, and returns its time.
            says: part of the reason.
            request: method of the client and its arguments.
        """
        for _ in range(_ATTEMPTS):
            future = self.moving(*request)
            fault_s = fault()
            result = future.result(PATIENCE_S)
            stood_s = self.stood_after(fault_s)
            # A base that does not follow stands before the command reaches it.
            wait_until(lambda since_s=fault_s: self.zeroed_after(since_s) is not None, "zero velocity is commanded")
            ending = Ending(result, self.zeroed_after(fault_s), stood_s)
            if says in ending.why or not is_overload(ending.why):
                return ending
            self.make_good()
        raise AssertionError(f"{_ATTEMPTS} movements ended for another reason: {ending.why}")

    def second(self, name: str, *arguments: Any) -> Attempt:
        """Request another movement."""
        return attempt(self.client, lambda: self.true_pose, name, *arguments)
