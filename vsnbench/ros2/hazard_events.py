"""Subscriptions to the hazard sensors of a base.

Without `irobot_create_msgs`, which only a distribution has, the operator has to report the collisions of a Create 3.
"""

from typing import Any

from std_msgs.msg import Bool

from vsnbench.ros2.installation import irobot_type
from vsnbench.ros2.interface import Ros2Interface
from vsnbench.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.sensing.hazards import Hazard, TakeHazard

HAZARDS_OF_A_CREATE3 = {1: Hazard.BUMPER, 2: Hazard.CLIFF, 4: Hazard.WHEEL_DROP}
"""Hazards by HazardDetection.type; the other types (backup limit, stall, proximity) are neither contacts nor drops."""


def subscribe_hazards(node: Ros2Node, names: Ros2Interface, take: TakeHazard) -> list[str]:
    """Pass every hazard event to `take`. Returns the topics whose message type is not installed."""
    unsupported = []
    if names.bumper:
        node.rclpy.create_subscription(
            Bool, names.bumper, lambda message: take(Hazard.BUMPER, 0, bool(message.data), "somewhere"), SENSOR_DATA
        )
    if names.hazards:
        vector = irobot_type("msg", "HazardDetectionVector")
        if vector is None:
            unsupported.append(names.hazards)
        else:
            node.rclpy.create_subscription(vector, names.hazards, HazardVectors(take), SENSOR_DATA)
    return unsupported


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
