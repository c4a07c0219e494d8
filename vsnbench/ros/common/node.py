"""What the process of a ROS node runs."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

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
