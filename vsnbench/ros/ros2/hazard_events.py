"""Subscriptions to the hazard sensors of a base.

Without `irobot_create_msgs`, which only a distribution has, the operator has to report the collisions of a Create 3.
"""

from typing import Any

from std_msgs.msg import Bool

from vsnbench.ros.ros2.installation import irobot_type
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.sensing.hazards import Hazard, TakeHazard

HAZARDS_OF_A_CREATE3 = {1: Hazard.BUMPER, 2: Hazard.CLIFF, 4: Hazard.WHEEL_DROP}
"""Hazards by HazardDetection.type; the other types (backup limit, stall, proximity) are neither contacts nor drops."""


def subscribe_hazards(node: Ros2Node, names: Ros2Interface, take: TakeHazard) -> None:
    """Pass every hazard event to `take`, of the topics whose message type is installed."""
    readers = {
        "bumper": (Bool, lambda message: take(Hazard.BUMPER, 0, bool(message.data), "somewhere")),
        "hazards": (irobot_type("msg", "HazardDetectionVector"), HazardVectors(take)),
    }
    for part in names.hazard_topics:
        if not part.missing_package:
            message_class, on_message = readers[part.field]
            node.rclpy.create_subscription(message_class, part.topic, on_message, SENSOR_DATA)


class HazardVectors:
    """Converts vectors of active hazards to events."""

    def __init__(self, take: TakeHazard) -> None:
        self._take = take
        self._active: set[tuple[Hazard, str]] = set()
        self._numbers: dict[tuple[Hazard, str], int] = {}

    def __call__(self, message: Any) -> None:
        """Take an irobot_create_msgs/HazardDetectionVector."""
        active = {
            (HAZARDS_OF_A_CREATE3[detection.type], str(detection.header.frame_id))
            for detection in message.detections
            if detection.type in HAZARDS_OF_A_CREATE3
        }
        for began, changed in ((True, active - self._active), (False, self._active - active)):
            for hazard, where in sorted(changed):
                number = self._numbers.setdefault((hazard, where), len(self._numbers))
                self._take(hazard, number, began, where)
        self._active = active
