"""Messages that a stack takes and sends over ROS 1."""

import io
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import genpy
import rosgraph.names
import roslib.message
import rospy

from vsnbench.errors import ModelError, ModelLostError
from vsnbench.ros.ros1.master import Master, MasterError, SystemState
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES
from vsnbench.sensing.exchange import (
    ActionGoal,
    Exchange,
    generation_of,
    unknown_field,
    unknown_type,
    wrong_type,
)
from vsnbench.text.sanitize import error_line

_POLL_S = 0.1


class Ros1Exchange(Exchange):
    """Topics on the network of a master."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._publishers: dict[tuple[str, str], rospy.Publisher] = {}

    def check(self, kind: str, content: Mapping[str, Any]) -> None:
        """Make sure that a type is installed and that content fits it; see `Exchange`."""
        _filled(kind, content)

    def publish(self, topic: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> None:
        """Publish one message, once another node subscribes to it; see `Exchange`."""
        message, key = _filled(kind, content), (topic, kind)
        if key not in self._publishers:
            self._publishers[key] = rospy.Publisher(topic, type(message), queue_size=5, tcp_nodelay=True)
        publisher = self._publishers[key]
        self._await(lambda state: state.subscribers, topic, kind, "subscribes to", timeout_s)
        _wait(lambda: publisher.get_num_connections() > 0, timeout_s)
        publisher.publish(message)

    def listen(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        """Pass each message of a topic to `take`."""
        rospy.Subscriber(topic, _class_of(kind), take, queue_size=20, tcp_nodelay=True)

    def await_publisher(self, topic: str, kind: str, timeout_s: float) -> None:
        """Wait until another node publishes a topic; see `Exchange`."""
        self._await(lambda state: state.publishers, topic, kind, "publishes", timeout_s)

    def send_goal(self, name: str, *_: object) -> ActionGoal:
        """Never called: `check` accepts no action."""
        raise NotImplementedError(name)

    def _await(
        self,
        of: Callable[[SystemState], Mapping[str, list[str]]],
        topic: str,
        kind: str,
        does: str,
        timeout_s: float,
    ) -> None:
        name, wanted = rosgraph.names.resolve_name(topic, rospy.get_name()), generation_of(kind)
        try:
            found = _wait(lambda: self._has_other(of(self._master.state()).get(name, [])), timeout_s)
            actual = self._master.topic_types().get(name, wanted)
        except MasterError as error:
            raise ModelLostError(str(error)) from error
        if not found:
            raise ModelLostError(f"no node {does} {name} ({wanted})", advice="start the stack, or correct its file")
        if actual not in (wanted, "*"):
            raise wrong_type(name, wanted, [actual])

    def _has_other(self, nodes: Sequence[str]) -> bool:
        """Return whether another node is alive; the master keeps those that were killed."""
        return any(node != self._master.caller and self._master.live_node(node) for node in nodes)


def _class_of(kind: str) -> Any:
    name = generation_of(kind)
    if "/action/" in name:
        raise ModelError(
            f"{kind}: an action needs ROS 2",
            advice="over ROS 1 use the topics of its server, such as /move_base_simple/goal",
            code="no-ros1-action",
        )
    try:
        found = MESSAGE_CLASSES.get(name) or roslib.message.get_message_class(name)
    except Exception as error:  # of the package's own code
        raise unknown_type(name, f"its package fails: {error_line(error)}") from error
    if found is None:
        package = name.partition("/")[0]
        raise unknown_type(name, f"source the workspace that has {package}, or correct the stack's file")
    return found


def _filled(kind: str, content: Mapping[str, Any]) -> Any:
    message = _class_of(kind)()
    try:
        if content:
            genpy.message.fill_message_args(message, [dict(content)])
        message.serialize(io.BytesIO())
    except (genpy.MessageException, genpy.SerializationError, ValueError, TypeError, AttributeError) as error:
        raise unknown_field(generation_of(kind), error_line(error, named=False)) from error
    return message


def _wait(condition: Callable[[], bool], timeout_s: float) -> bool:
    give_up_s = time.monotonic() + timeout_s
    while not (holds := condition()) and time.monotonic() < give_up_s:
        time.sleep(_POLL_S)
    return holds
