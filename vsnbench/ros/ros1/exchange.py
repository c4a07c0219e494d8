"""Messages that a stack takes and sends over ROS 1."""

import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import genpy
import rosgraph.names
import roslib.message
import rospy

from vsnbench.errors import ModelLostError
from vsnbench.ros.common.node import wait_until
from vsnbench.ros.ros1.master import Master, MasterError, SystemState
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES
from vsnbench.sensing.exchange import (
    Exchange,
    no_actions,
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
        wait_until(lambda: publisher.get_num_connections() > 0, timeout_s, _POLL_S)
        publisher.publish(message)

    def listen(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        """Pass each message of a topic to `take`."""
        rospy.Subscriber(topic, _class_of(kind), take, queue_size=20, tcp_nodelay=True)

    def await_publisher(self, topic: str, kind: str, timeout_s: float) -> None:
        """Wait until another node publishes a topic; see `Exchange`."""
        self._await(lambda state: state.publishers, topic, kind, "publishes", timeout_s)

    def _await(
        self,
        of: Callable[[SystemState], Mapping[str, list[str]]],
        topic: str,
        kind: str,
        does: str,
        timeout_s: float,
    ) -> None:
        name, wanted = rosgraph.names.resolve_name(topic, rospy.get_name()), _name_of(kind)
        try:
            found = wait_until(lambda: self._has_other(of(self._master.state()).get(name, [])), timeout_s, _POLL_S)
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


def _name_of(kind: str) -> str:
    """Return the name of a type in ROS 1."""
    return kind.replace("/msg/", "/")


def _class_of(kind: str) -> Any:
    name = _name_of(kind)
    if "/action/" in name:
        raise no_actions(kind)
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
        raise unknown_field(_name_of(kind), error_line(error, named=False)) from error
    return message
