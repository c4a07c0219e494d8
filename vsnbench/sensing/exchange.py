"""Messages and actions that a stack takes and sends on the network of its robot, as its file describes them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from vsnbench.errors import ModelError


class ActionGoal(ABC):
    """A goal that an action server has been sent."""

    @property
    @abstractmethod
    def outcome(self) -> str:
        """How it ended: `succeeded`, `aborted`, `canceled` or `refused`; empty while it has not."""

    @abstractmethod
    def cancel(self, timeout_s: float) -> None:
        """Ask the server to cancel it, and wait for the answer; does nothing once it has ended.

        Raises:
            ModelLostError: the server does not answer in time.
        """


class Exchange(ABC):
    """Topics and actions of other nodes by name, type and content. A relative name is in the robot's namespace.

    A type is written as either ROS generation writes it: `std_msgs/String` or `std_msgs/msg/String`.
    """

    @abstractmethod
    def check(self, kind: str, content: Mapping[str, Any]) -> None:
        """Make sure that a type is installed, and that content fits a message of it, or the goal of an action.

        Raises:
            ModelError: it is not (`unknown-message-type`), or it does not (`unknown-message-field`).
        """

    @abstractmethod
    def publish(self, topic: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> None:
        """Publish one message, once another node subscribes to it.

        Raises:
            ModelLostError: no node does in time.
            ModelError: the topic has another type.
        """

    @abstractmethod
    def listen(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        """Pass each message of a topic to `take`, in a thread of the network, until the robot is closed."""

    @abstractmethod
    def await_publisher(self, topic: str, kind: str, timeout_s: float) -> None:
        """Wait until another node publishes a topic.

        Raises:
            ModelLostError: no node does in time.
            ModelError: the topic has another type.
        """

    def send_goal(self, name: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> ActionGoal:
        """Send a goal to an action server, and return once it has accepted or refused it.

        Raises:
            ModelLostError: no server answers in time.
            ModelError: the network has no actions, which is the default (`no-ros1-action`).
        """
        del name, content, timeout_s
        raise no_actions(kind)


def no_actions(kind: str) -> ModelError:
    """Return the error of an action on a network that has none."""
    return ModelError(
        f"{kind}: an action needs ROS 2",
        advice="over ROS 1 use the topics of its server, such as /move_base_simple/goal",
        code="no-ros1-action",
    )


def unknown_type(kind: str, advice: str) -> ModelError:
    """Return the error of a type that is not installed."""
    return ModelError(f"message type {kind} is not installed here", advice=advice, code="unknown-message-type")


def unknown_field(kind: str, problem: str) -> ModelError:
    """Return the error of content that does not fit a type."""
    return ModelError(f"the content does not fit {kind}: {problem}", code="unknown-message-field")


def wrong_type(topic: str, kind: str, found: Sequence[str]) -> ModelError:
    """Return the error of a topic that other nodes have with another type."""
    return ModelError(
        f"{topic} is a {' and '.join(found)}, not a {kind}",
        advice="correct `type` in the stack's file",
        code="wrong-topic-type",
    )


def value_at(message: Any, field: str) -> Any:
    """Return a value in a message by the path of its field, such as `status.status` or `data`.

    Raises:
        ModelError: the message has no such field.
    """
    for name in field.split("."):
        try:
            message = message[int(name)] if name.isdigit() else getattr(message, name)
        except (AttributeError, IndexError, TypeError) as error:
            raise unknown_field(type(message).__name__, f"no field {name} of {field}") from error
    return message
