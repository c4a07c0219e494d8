"""Bumper, cliff and wheel-drop topics of a base, whatever type they have.

Imported only where ROS is installed.
"""

from collections.abc import Callable
from typing import Any

import rospy
from std_msgs.msg import Bool

from vsnbench.ros1.interface import Ros1Interface
from vsnbench.ros1.messages import BumperEvent, CliffEvent, WheelDropEvent
from vsnbench.sensing.discrete_mover import Hazard

TakeHazard = Callable[[Hazard, int, bool, str], None]
"""Called with the hazard, the number of the sensor, whether it is active, and where it sits."""

_SIDES = ("left", "centre", "right")
_WHEELS = ("left", "right")


def hazard_topic(names: Ros1Interface, hazard: Hazard) -> tuple[str, str]:
    """Return topic and message type of a hazard; the topic is empty when the base has none."""
    if hazard is Hazard.BUMPER:
        return names.bumper, names.bumper_type
    if hazard is Hazard.CLIFF:
        return names.cliff, names.cliff_type
    return names.wheel_drop, names.wheel_drop_type


def subscribe_hazard(names: Ros1Interface, hazard: Hazard, take: TakeHazard) -> None:
    """Report every event of a hazard to `take`; does nothing when the base has none."""
    topic, kind = hazard_topic(names, hazard)
    if not topic:
        return
    message_class, read = _READERS[kind]

    def on_event(message: Any) -> None:
        sensor, active, where = read(message)
        take(hazard, sensor, active, where)

    rospy.Subscriber(topic, message_class, on_event, queue_size=50, tcp_nodelay=True)


def _named(places: tuple[str, ...], index: int) -> str:
    return places[index] if index < len(places) else str(index)


_READERS: dict[str, tuple[Any, Callable[[Any], tuple[int, bool, str]]]] = {
    "kobuki_msgs/BumperEvent": (
        BumperEvent,
        lambda m: (m.bumper, m.state == BumperEvent.PRESSED, _named(_SIDES, m.bumper)),
    ),
    "kobuki_msgs/CliffEvent": (
        CliffEvent,
        lambda m: (m.sensor, m.state == CliffEvent.CLIFF, _named(_SIDES, m.sensor)),
    ),
    "kobuki_msgs/WheelDropEvent": (
        WheelDropEvent,
        lambda m: (m.wheel, m.state == WheelDropEvent.DROPPED, _named(_WHEELS, m.wheel)),
    ),
    "std_msgs/Bool": (Bool, lambda m: (0, bool(m.data), "somewhere")),
}
