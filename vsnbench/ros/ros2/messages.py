"""Conversion of ROS 2 messages; images stay serialized until they are needed."""

import array
import struct
from typing import Any

import numpy.typing as npt
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from vsnbench.control.command import Command
from vsnbench.errors import ImageError
from vsnbench.ros.common.messages import PinholeMatrices, fill_image, fill_odometry, fill_twist, turned
from vsnbench.ros.ros2.interface import TWIST, TWIST_STAMPED
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

OPTICAL_FRAME = "camera_optical_frame"
COMMAND_CLASSES: dict[str, Any] = {TWIST: Twist, TWIST_STAMPED: TwistStamped}
"""Message classes of velocities by type."""


def seconds(stamp: Any) -> float:
    """Return a stamp in seconds."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def time_of(stamp_s: float) -> Any:
    """Return seconds as a stamp."""
    nanoseconds = round(stamp_s * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def stamp_of_serialized(data: bytes) -> float:
    """Return the stamp in the header of a serialized message in seconds; 0 for a message without a header."""
    if len(data) < 12:
        return 0.0
    # The lowest bit of the second byte marks little-endian data.
    sec, nanosec = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return float(sec) + float(nanosec) * 1e-9


class CompressedBytes(bytes):
    """A serialized sensor_msgs/CompressedImage."""


def image_of_serialized(data: bytes) -> Any:
    """Return a serialized sensor_msgs/Image, or a CompressedImage from CompressedBytes.

    Raises:
        ImageError: the data is not such a message.
    """
    try:
        return deserialize_message(bytes(data), CompressedImage if isinstance(data, CompressedBytes) else Image)
    except Exception as error:
        raise ImageError(f"an image of {len(data)} bytes cannot be read") from error


def velocity_message(command: Command, kind: str, stamp: Any) -> Any:
    """Return a velocity as a message of type `kind`."""
    twist = Twist()
    fill_twist(twist, command)
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
    fill_odometry(message, pose, frame_id, "base_link")
    return message


def image_message(pixels: npt.NDArray[Any], encoding: str, stamp_s: float, turns: int = 0) -> Any:
    """Return an upright image as sensor_msgs/Image of a camera that is mounted `turns` quarter turns anticlockwise."""
    pixels = turned(pixels, turns)
    message = Image()
    message.header.stamp, message.header.frame_id = time_of(stamp_s), OPTICAL_FRAME
    fill_image(message, pixels, encoding)
    message.data = array.array("B", pixels.tobytes())
    return message


def camera_info_message(camera: Camera, stamp_s: float, turns: int = 0) -> Any:
    """Return the calibration of a camera as sensor_msgs/CameraInfo."""
    matrices = PinholeMatrices.of(camera, turns)
    info = CameraInfo(width=matrices.width, height=matrices.height, distortion_model="plumb_bob", d=list(matrices.d))
    info.header.stamp, info.header.frame_id = time_of(stamp_s), OPTICAL_FRAME
    info.k, info.p, info.r = matrices.k, matrices.p, list(matrices.r)
    return info
