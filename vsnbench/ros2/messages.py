"""ROS 2 messages to and from plain values; images stay bytes until somebody wants to see them.

Imported only where ROS 2 is installed.
"""

import array
import math
import struct
from typing import Any

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros2.interface import TWIST, TWIST_STAMPED
from vsnbench.sensing.camera_images import ImageError
from vsnbench.sensing.odometry import heading_of_quaternion

COMMAND_CLASSES: dict[str, Any] = {TWIST: Twist, TWIST_STAMPED: TwistStamped}
"""Message classes of velocities, by their type's name."""


def seconds(stamp: Any) -> float:
    """Return a stamp as seconds."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def time_of(stamp_s: float) -> Any:
    """Return seconds as a stamp."""
    nanoseconds = round(stamp_s * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def stamp_of_serialized(data: bytes) -> float:
    """Return the stamp of a serialized message that begins with a header; 0 where it is too short for one."""
    if len(data) < 12:
        return 0.0
    # The second byte says whether what follows is little-endian.
    sec, nanosec = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return float(sec) + float(nanosec) * 1e-9


def image_of_serialized(data: bytes) -> Any:
    """Return a serialized sensor_msgs/Image.

    Raises:
        ImageError: the bytes are none.
    """
    try:
        return deserialize_message(data, Image)
    except Exception as error:
        raise ImageError(f"an image of {len(data)} bytes cannot be read") from error


def planar(message: Any) -> tuple[float, float, float]:
    """Return x, y and heading of an odometry message."""
    pose = message.pose.pose
    turn = pose.orientation
    return pose.position.x, pose.position.y, heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)


def velocity_message(command: Command, kind: str, stamp: Any) -> Any:
    """Return a velocity as a message of a type's name."""
    twist = Twist()
    twist.linear.x = float(command.linear_m_s)
    twist.angular.z = float(command.angular_rad_s)
    if kind == TWIST:
        return twist
    stamped = TwistStamped(twist=twist)
    stamped.header.stamp = stamp
    stamped.header.frame_id = "base_link"
    return stamped


def twist_of(message: Any) -> Any:
    """Return the velocity in a Twist or TwistStamped."""
    return message.twist if isinstance(message, TwistStamped) else message


def odometry_message(pose: Pose, stamp_s: float, frame_id: str) -> Any:
    """Return a pose as nav_msgs/Odometry."""
    message = Odometry()
    message.header.stamp = time_of(stamp_s)
    message.header.frame_id = frame_id
    message.child_frame_id = "base_link"
    message.pose.pose.position.x, message.pose.pose.position.y = map(float, pose.position)
    message.pose.pose.orientation.z = math.sin(pose.heading_rad / 2)
    message.pose.pose.orientation.w = math.cos(pose.heading_rad / 2)
    return message


def image_message(pixels: npt.NDArray[Any], encoding: str, stamp_s: float, turns: int = 0) -> Any:
    """Return pixels as sensor_msgs/Image, turned back as a camera sees them that sits `turns` quarter turns askew."""
    pixels = np.ascontiguousarray(np.rot90(pixels, turns))
    message = Image()
    message.header.stamp = time_of(stamp_s)
    message.header.frame_id = "camera_optical_frame"
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.step = pixels[0].nbytes
    message.data = array.array("B", pixels.tobytes())
    return message


def camera_info_message(profile: RobotProfile, stamp_s: float, turns: int = 0) -> Any:
    """Return how a profile's camera is calibrated, as sensor_msgs/CameraInfo."""
    camera = profile.camera
    focal, (cx, cy) = camera.focal_px, camera.center_px
    width, height = camera.width, camera.height
    if turns % 2:
        width, height, cx, cy = height, width, cy, cx
    info = CameraInfo(width=width, height=height, distortion_model="plumb_bob", d=[0.0] * 5)
    info.header.stamp = time_of(stamp_s)
    info.header.frame_id = "camera_optical_frame"
    info.k = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
    info.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.p = [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info
