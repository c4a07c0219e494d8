"""Subscriptions to the bumper, cliff and wheel-drop topics of a base.

A Kobuki publishes there only when a sensor changes; its state has the sensors that were active before.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import rospy

from vsnbench.ros.common.hazard_topics import HazardTopic
from vsnbench.ros.ros1.interface import KOBUKI_STATE, Ros1Interface
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES, SensorState
from vsnbench.sensing.hazards import Hazard, TakeHazard

_SIDES = ("left", "centre", "right")
_WHEELS = ("left", "right")
_HAZARDS = {"bumper": Hazard.BUMPER, "cliff": Hazard.CLIFF, "wheel_drop": Hazard.WHEEL_DROP}
"""Hazards by the field that names the topic."""


def subscribe_hazards(topics: Iterable[HazardTopic], take: TakeHazard) -> None:
    """Pass every event of the hazard sensors of a base to `take`."""
    for part in topics:
        on_event = partial(_take_event, _HAZARDS[part.field], _READERS[part.kind], take)
        rospy.Subscriber(part.topic, MESSAGE_CLASSES[part.kind], on_event, queue_size=50, tcp_nodelay=True)


def subscribe_states(names: Ros1Interface, take: TakeHazard) -> None:
    """Pass the changes of the state of a Kobuki to `take`, for a sensor that was active before the subscription."""
    if names.battery and names.battery_type == KOBUKI_STATE:
        rospy.Subscriber(names.battery, SensorState, KobukiStates(take), queue_size=5, tcp_nodelay=True)


class KobukiStates:
    """Converts kobuki_msgs/SensorState to events of the same sensors as its bumper, cliff and wheel-drop topics."""

    def __init__(self, take: TakeHazard) -> None:
        self._take = take
        self._bits = {Hazard.BUMPER: 0, Hazard.CLIFF: 0, Hazard.WHEEL_DROP: 0}

    def __call__(self, state: Any) -> None:
        """Take a SensorState: the lowest bit of each field is the sensor at the right."""
        now = {Hazard.BUMPER: state.bumper, Hazard.CLIFF: state.cliff, Hazard.WHEEL_DROP: state.wheel_drop}
        for hazard, bits in now.items():
            positions = _WHEELS if hazard is Hazard.WHEEL_DROP else _SIDES
            for bit, (sensor, where) in enumerate(reversed(list(enumerate(positions)))):
                if (bits ^ self._bits[hazard]) >> bit & 1:
                    self._take(hazard, sensor, bool(bits >> bit & 1), where)
        self._bits = now


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
