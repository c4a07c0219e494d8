"""What a base reports of its own bumper, cliffs and wheels, where its message types are on this machine.

Imported only where ROS 2 is installed. `irobot_create_msgs` comes with the robot's distribution and in no wheel;
without it a collision of a Create 3 is a person's word.
"""

from collections.abc import Callable
from typing import Any

from std_msgs.msg import Bool

from vsnbench.ros2.installation import irobot_type
from vsnbench.ros2.interface import Ros2Interface
from vsnbench.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.sensing.discrete_mover import Hazard

TakeHazard = Callable[[Hazard, int, bool, str], None]
"""Called with the hazard, the number of the sensor, whether it is active, and where it sits."""

HAZARDS_OF_A_CREATE3 = {1: Hazard.BUMPER, 2: Hazard.CLIFF, 4: Hazard.WHEEL_DROP}
"""HazardDetection.type by its number; the others (backup limit, stall, proximity) are no contact and no drop."""


def subscribe_hazards(node: Ros2Node, names: Ros2Interface, take: TakeHazard) -> list[str]:
    """Report every event to `take`; returns the topics that cannot be listened to for want of their type."""
    unheard = []
    if names.bumper:
        node.rclpy.create_subscription(
            Bool, names.bumper, lambda message: take(Hazard.BUMPER, 0, bool(message.data), "somewhere"), SENSOR_DATA
        )
    if names.hazards:
        vector = irobot_type("msg", "HazardDetectionVector")
        if vector is None:
            unheard.append(names.hazards)
        else:
            node.rclpy.create_subscription(vector, names.hazards, HazardVectors(take), SENSOR_DATA)
    return unheard


class HazardVectors:
    """Turns vectors of what is active now into events of what began and ended."""

    def __init__(self, take: TakeHazard) -> None:
        self._take = take
        self._active: set[tuple[Hazard, str]] = set()
        self._numbers: dict[tuple[Hazard, str], int] = {}

    def __call__(self, message: Any) -> None:
        """Take an irobot_create_msgs/HazardDetectionVector."""
        active = {
            (HAZARDS_OF_A_CREATE3[one.type], str(one.header.frame_id))
            for one in message.detections
            if one.type in HAZARDS_OF_A_CREATE3
        }
        for began, changed in ((True, active - self._active), (False, self._active - active)):
            for hazard, where in sorted(changed):
                number = self._numbers.setdefault((hazard, where), len(self._numbers))
                self._take(hazard, number, began, where)
        self._active = active
