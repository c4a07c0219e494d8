"""Subscriptions to the bumper, cliff and wheel-drop topics of a base.

Imported only where ROS 1 is installed.
"""

from collections.abc import Callable
from typing import Any

import rospy
from std_msgs.msg import Bool

from vsnbench.ros1.interface import Ros1Interface
from vsnbench.ros1.messages import BumperEvent, CliffEvent, WheelDropEvent
from vsnbench.sensing.hazards import Hazard, TakeHazard

_SIDES = ("left", "centre", "right")
_WHEELS = ("left", "right")


def subscribe_hazards(names: Ros1Interface, take: TakeHazard) -> None:
    """Pass every event of the hazard sensors of a base to `take`."""
    topics = {
        Hazard.BUMPER: (names.bumper, names.bumper_type),
        Hazard.CLIFF: (names.cliff, names.cliff_type),
        Hazard.WHEEL_DROP: (names.wheel_drop, names.wheel_drop_type),
    }
    for hazard, (topic, kind) in topics.items():
        if topic:
            _subscribe(hazard, topic, kind, take)


def _subscribe(hazard: Hazard, topic: str, kind: str, take: TakeHazard) -> None:
    message_class, read = _READERS[kind]

    def on_event(message: Any) -> None:
        sensor, active, where = read(message)
        take(hazard, sensor, active, where)

    rospy.Subscriber(topic, message_class, on_event, queue_size=50, tcp_nodelay=True)


def _position(positions: tuple[str, ...], sensor: int) -> str:
    return positions[sensor] if sensor < len(positions) else str(sensor)


_READERS: dict[str, tuple[Any, Callable[[Any], tuple[int, bool, str]]]] = {
    "kobuki_msgs/BumperEvent": (
        BumperEvent,
        lambda m: (m.bumper, m.state == BumperEvent.PRESSED, _position(_SIDES, m.bumper)),
    ),
    "kobuki_msgs/CliffEvent": (
        CliffEvent,
        lambda m: (m.sensor, m.state == CliffEvent.CLIFF, _position(_SIDES, m.sensor)),
    ),
    "kobuki_msgs/WheelDropEvent": (
        WheelDropEvent,
        lambda m: (m.wheel, m.state == WheelDropEvent.DROPPED, _position(_WHEELS, m.wheel)),
    ),
    "std_msgs/Bool": (Bool, lambda m: (0, bool(m.data), "somewhere")),
}
"""Message class and reader (sensor number, active, position) by type."""
