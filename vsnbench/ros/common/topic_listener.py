"""Collects the messages of a robot's topics for the check-up."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.odometry import OdometryReader, TakeOdometry
from vsnbench.sensing.topic_monitor import TopicMessages, TopicMonitor


class TopicListener(ABC):
    """A node that records the serialized messages of several topics."""

    connecting_s: float
    """Time in which publishers connect; messages that arrive in it are dropped."""

    def __init__(self, topics: Iterable[str]) -> None:
        self.monitor = TopicMonitor(topics)

    def listen(self, seconds: float) -> dict[str, TopicMessages]:
        """Wait, and return the messages of each topic."""
        return self.monitor.listen(self.connecting_s, seconds)

    @abstractmethod
    def follow_odometry(self, names: RosInterface, take: TakeOdometry[str]) -> OdometryReader[Any]:
        """Pass the odometry of a base to `take`, with the name of the sending node.

        Raises:
            RobotError: the source is TF, and the type of its messages is not installed.
        """

    @abstractmethod
    def close(self) -> None:
        """Leave the network."""
