"""Subscriptions to the bumper, cliff and wheel-drop topics of a base."""

from collections.abc import Callable
from functools import partial
from typing import Any

import rospy

from vsnbench.ros1.interface import Ros1Interface
from vsnbench.ros1.messages import MESSAGE_CLASSES
from vsnbench.sensing.hazards import Hazard, TakeHazard

_SIDES = ("left", "centre", "right")
_WHEELS = ("left", "right")


def subscribe_hazards(names: Ros1Interface, take: TakeHazard) -> None:
    """Pass every event of the hazard sensors of a base to `take`."""
    for hazard, topic, kind in (
        (Hazard.BUMPER, names.bumper, names.bumper_type),
        (Hazard.CLIFF, names.cliff, names.cliff_type),
        (Hazard.WHEEL_DROP, names.wheel_drop, names.wheel_drop_type),
    ):
        if topic:
            on_event = partial(_take_event, hazard, _READERS[kind], take)
            rospy.Subscriber(topic, MESSAGE_CLASSES[kind], on_event, queue_size=50, tcp_nodelay=True)


def _take_event(hazard: Hazard, read: Callable[[Any], tuple[int, bool, str]], take: TakeHazard, message: Any) -> None:
    sensor, active, where = read(message)
    take(hazard, sensor, active, where)


def _position(positions: tuple[str, ...], sensor: int) -> str:
    return positions[sensor] if sensor < len(positions) else str(sensor)


_READERS: dict[str, Callable[[Any], tuple[int, bool, str]]] = {
    "kobuki_msgs/BumperEvent": lambda m: (m.bumper, m.state == m.PRESSED, _position(_SIDES, m.bumper)),
    "kobuki_msgs/CliffEvent": lambda m: (m.sensor, m.state == m.CLIFF, _position(_SIDES, m.sensor)),
    "kobuki_msgs/WheelDropEvent": lambda m: (m.wheel, m.state == m.DROPPED, _position(_WHEELS, m.wheel)),
    "std_msgs/Bool": lambda m: (0, bool(m.data), "somewhere"),
}
"""Reader of a message by its type: sensor number, whether it is active, position."""
