"""Messages with the maker's names and fields in Python, and other types on the wire.

The fields are those of irobot_create_msgs 2 and 3: DockStatus.is_docked; HazardDetectionVector.detections, each with a
header and a type, whose numbers HazardDetection.msg lists.
"""

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as HazardDetectionVector
from std_msgs.msg import Bool as DockStatus

DockStatus.is_docked = property(lambda status: status.data)
HazardDetectionVector.detections = property(lambda vector: vector.poses)
PoseStamped.type = property(lambda detection: int(detection.pose.position.x))


def hazard_vector(*detections: tuple[int, str]) -> HazardDetectionVector:
    """Return the detections, (type, frame), as a message."""
    vector = HazardDetectionVector()
    for number, frame_id in detections:
        one = PoseStamped()
        one.header.frame_id, one.pose.position.x = frame_id, float(number)
        vector.poses.append(one)
    return vector
