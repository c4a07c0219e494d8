"""The message of TF by its name and fields in Python, with another type on the wire: nav_msgs/Path.

A pose's header has both frames of a transform in its frame_id.
"""

from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Path as TFMessage


def message_of(transforms: list[TransformStamped]) -> TFMessage:
    """Return transforms as a message."""
    message = TFMessage()
    for link in transforms:
        one = PoseStamped()
        one.header.stamp, one.header.frame_id = link.header.stamp, f"{link.header.frame_id}>{link.child_frame_id}"
        shift = link.transform.translation
        one.pose.position.x, one.pose.position.y, one.pose.position.z = shift.x, shift.y, shift.z
        one.pose.orientation = link.transform.rotation
        message.poses.append(one)
    return message


def _transform(one: PoseStamped) -> TransformStamped:
    link = TransformStamped()
    link.header.stamp, (link.header.frame_id, link.child_frame_id) = one.header.stamp, one.header.frame_id.split(">")
    shift = one.pose.position
    link.transform.translation.x, link.transform.translation.y, link.transform.translation.z = shift.x, shift.y, shift.z
    link.transform.rotation = one.pose.orientation
    return link


TFMessage.transforms = property(lambda message: list(map(_transform, message.poses)))
