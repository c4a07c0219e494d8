"""What the process of a ROS node runs."""

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

_LONGEST_SLEEP_S = 1.0
_POLL_S = 0.001
LAST_MESSAGES_S = 0.1
"""Time in which the threads of the middleware send the last command before the node closes."""


class NodeTask(ABC):
    """The task of a node; it runs in its own threads until it is closed."""

    @abstractmethod
    def close(self) -> None:
        """Stop the task and leave the robot at zero velocity."""


def sleep_until(due_s: float, now_s: Callable[[], float], is_simulated: Callable[[], bool]) -> None:
    """Sleep until `now_s()` reaches `due_s`, or for _LONGEST_SLEEP_S of real time.

    The sleep of ROS has no such limit: it hangs when the simulated clock stops.
    """
    give_up_s = time.monotonic() + _LONGEST_SLEEP_S
    while (left_s := due_s - now_s()) > 0 and time.monotonic() < give_up_s:
        time.sleep(_POLL_S if is_simulated() else min(left_s, _LONGEST_SLEEP_S))


def wait_until(condition: Callable[[], bool], timeout_s: float, poll_s: float) -> bool:
    """Wait until a condition holds, and return whether it does in time; it is evaluated at least once."""
    give_up_s = time.monotonic() + timeout_s
    while not (holds := condition()) and time.monotonic() < give_up_s:
        time.sleep(poll_s)
    return holds


def result_of(future: Any, timeout_s: float) -> Any:
    """Return the result of a future of a node that spins in another thread.

    Raises:
        TimeoutError: it has none in time.
    """
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(timeout_s):
        raise TimeoutError
    return future.result()
