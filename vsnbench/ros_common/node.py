"""What the process of a ROS node runs."""

from abc import ABC, abstractmethod

LAST_MESSAGES_S = 0.1
"""Time in which the threads of the middleware send the last command before the node closes."""


class NodeTask(ABC):
    """The task of a node; it runs in its own threads until it is closed."""

    @abstractmethod
    def close(self) -> None:
        """Stop the task and leave the robot at zero velocity."""
