"""Messages and actions that a stack takes and sends over ROS 2."""

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Final

from rclpy.qos import QoSReliabilityPolicy

from vsnbench.errors import ModelLostError
from vsnbench.ros.common.node import result_of, wait_until
from vsnbench.ros.ros2.graph import Endpoint, Graph
from vsnbench.ros.ros2.node import RELIABLE, SENSOR_DATA, Ros2Node
from vsnbench.sensing.exchange import ActionGoal, Exchange, unknown_field, unknown_type, wrong_type
from vsnbench.text.sanitize import error_line

_POLL_S = 0.02
_OUTCOMES: Final = {4: "succeeded", 5: "canceled", 6: "aborted"}
"""By action_msgs/GoalStatus."""


class Ros2Exchange(Exchange):
    """Topics and actions on the graph of a node."""

    def __init__(self, node: Ros2Node, graph: Graph) -> None:
        self._node = node
        self._graph = graph
        self._publishers: dict[tuple[str, str], Any] = {}
        self._clients: dict[tuple[str, str], Any] = {}

    def check(self, kind: str, content: Mapping[str, Any]) -> None:
        """Make sure that a type is installed and that content fits it; see `Exchange`."""
        self._filled(kind, content)

    def publish(self, topic: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> None:
        """Publish one message, once another node subscribes to it; see `Exchange`."""
        message, key = self._filled(kind, content), (topic, kind)
        name = self._node.rclpy.resolve_topic_name(topic)
        self._await(self._graph.subscribers, name, kind, "subscribes to", timeout_s)
        if key not in self._publishers:
            self._publishers[key] = self._node.rclpy.create_publisher(type(message), topic, RELIABLE)
        publisher = self._publishers[key]
        wait_until(lambda: publisher.get_subscription_count() > 0, timeout_s, _POLL_S)  # the subscriber is matched
        publisher.publish(message)

    def listen(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        """Pass each message of a topic to `take`."""
        publishers = self._graph.publishers(self._node.rclpy.resolve_topic_name(topic))
        is_lossy = any(publisher.qos.reliability == QoSReliabilityPolicy.BEST_EFFORT for publisher in publishers)
        self._node.rclpy.create_subscription(_class_of(kind), topic, take, SENSOR_DATA if is_lossy else RELIABLE)

    def await_publisher(self, topic: str, kind: str, timeout_s: float) -> None:
        """Wait until another node publishes a topic; see `Exchange`."""
        name = self._node.rclpy.resolve_topic_name(topic)
        self._await(self._graph.publishers, name, kind, "publishes", timeout_s)

    def send_goal(self, name: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> ActionGoal:
        """Send a goal to an action server; see `Exchange`."""
        goal, key = self._filled(kind, content), (name, kind)
        if key not in self._clients:
            self._clients[key] = self._node.action_client(_class_of(kind), name)
        client = self._clients[key]
        if not client.wait_for_server(timeout_sec=timeout_s):
            raise ModelLostError(f"no node offers the action {name} ({kind})", advice="start the stack")
        sent = client.send_goal_async(goal)
        try:
            return _Goal(_answer(sent, timeout_s, f"the action {name} does not answer"), name)
        except BaseException:
            sent.add_done_callback(_cancel_late)
            raise

    def _filled(self, kind: str, content: Mapping[str, Any]) -> Any:
        found = _class_of(kind)
        message = (found.Goal if "/action/" in kind else found)()
        _fill(message, content, kind, "")
        return message

    def _await(
        self, endpoints: Callable[[str], list[Endpoint]], topic: str, kind: str, does: str, timeout_s: float
    ) -> None:
        wanted = _canonical(kind)

        def kinds() -> set[str]:
            return {endpoint.type_name for endpoint in endpoints(topic) if endpoint.node != self._node.full_name}

        if wait_until(lambda: wanted in kinds(), timeout_s, _POLL_S):
            return
        if found := kinds():
            raise wrong_type(topic, wanted, sorted(found))
        raise ModelLostError(f"no node {does} {topic} ({wanted})", advice="start the stack, or correct its file")


class _Goal(ActionGoal):
    """A goal by the handle of rclpy."""

    def __init__(self, handle: Any, name: str) -> None:
        self._handle = handle
        self._name = name
        self._result = handle.get_result_async() if handle.accepted else None

    @property
    def outcome(self) -> str:
        """How it ended; empty while it has not."""
        if self._result is None:
            return "refused"
        if not self._result.done():
            return ""
        return _OUTCOMES.get(self._result.result().status, "ended in an unknown state")

    def cancel(self, timeout_s: float) -> None:
        """Ask the server to cancel it."""
        if not self.outcome:
            _answer(self._handle.cancel_goal_async(), timeout_s, f"the action {self._name} does not cancel its goal")


def _canonical(kind: str) -> str:
    """Return the name of a type in ROS 2."""
    return kind if kind.count("/") == 2 else kind.replace("/", "/msg/")


def _class_of(kind: str) -> Any:
    package, part, name = _canonical(kind).split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{part}"), name)
    except (ImportError, AttributeError) as error:
        raise unknown_type(
            _canonical(kind), f"source the workspace that has {package} before vsnbench, or correct the stack's file"
        ) from error


def _fill(message: Any, content: Mapping[str, Any], kind: str, path: str) -> None:
    """Write content into a message.

    Raises:
        ModelError: a field does not exist, or takes no such value.
    """
    fields = message.get_fields_and_field_types()
    message._check_fields = True  # noqa: SLF001  # only then does rclpy check values
    for name, value in content.items():
        where = f"{path}{name}"
        if name not in fields:
            raise unknown_field(kind, f"no field {where}; it has {', '.join(fields) or 'none'}")
        present = getattr(message, name)
        if isinstance(value, Mapping):
            if not hasattr(present, "get_fields_and_field_types"):
                raise unknown_field(kind, f"{where} is a {fields[name]}")
            _fill(present, value, kind, f"{where}.")
            continue
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        given = float(value) if isinstance(present, float) and is_whole else value
        try:
            if isinstance(present, str | bool | int | float) and type(given) is not type(present):
                raise TypeError(f"got {value!r}")
            setattr(message, name, given)
        except (AssertionError, TypeError, ValueError) as error:
            raise unknown_field(kind, f"{where} is a {fields[name]}: {error_line(error, named=False)}") from error


def _answer(future: Any, timeout_s: float, otherwise: str) -> Any:
    """Return the answer of an action server.

    Raises:
        ModelLostError: there is none in time.
    """
    try:
        return result_of(future, timeout_s)
    except TimeoutError as error:
        raise ModelLostError(f"{otherwise} within {timeout_s:g} s") from error


def _cancel_late(sent: Any) -> None:
    """Cancel a goal that was accepted too late: the trial is over, so nothing else would stop the stack."""
    handle = sent.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()
