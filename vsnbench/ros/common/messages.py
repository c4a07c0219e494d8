"""Conversion of values to and from the fields of ROS messages that ROS 1 and ROS 2 share."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import Command
from vsnbench.sensing.odometry.odometry import heading_of_quaternion
from vsnbench.values.camera import Camera
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.pose import Attitude, Pose


def planar(message: Any) -> tuple[float, float, float]:
    """Return x and y in metres and the heading in radians of a nav_msgs/Odometry."""
    pose = message.pose.pose
    turn = pose.orientation
    return pose.position.x, pose.position.y, heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)


def command_of(twist: Any) -> Command:
    """Return the velocity of a geometry_msgs/Twist."""
    return Command(twist.linear.x, twist.angular.z, twist.linear.y)


def fill_twist(twist: Any, command: Command) -> None:
    """Write a velocity into a geometry_msgs/Twist."""
    twist.linear.x, twist.linear.y = float(command.linear_m_s), float(command.lateral_m_s)
    twist.angular.z = float(command.angular_rad_s)


def moves(twist: Any) -> bool:
    """Return whether a geometry_msgs/Twist moves a base."""
    return any((twist.linear.x, twist.linear.y, twist.angular.z))


def fill_odometry(message: Any, pose: Pose, frame_id: str, base_frame: str) -> None:
    """Write a pose into a nav_msgs/Odometry."""
    message.header.frame_id, message.child_frame_id = frame_id, base_frame
    message.pose.pose.position.x, message.pose.pose.position.y = map(float, pose.position)
    message.pose.pose.orientation.z = math.sin(pose.heading_rad / 2)
    message.pose.pose.orientation.w = math.cos(pose.heading_rad / 2)


def fill_orientation(orientation: Any, heading_rad: float, attitude: Attitude) -> None:
    """Write a heading and an attitude into a geometry_msgs/Quaternion."""
    halves = (attitude.roll_rad / 2, attitude.pitch_rad / 2, heading_rad / 2)
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(half), math.sin(half)) for half in halves)
    orientation.x, orientation.y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    orientation.z, orientation.w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy


def fill_transform(transform: Any, odometry: Any, odom_frame: str, base_frame: str) -> None:
    """Write a nav_msgs/Odometry into a geometry_msgs/TransformStamped between two frames."""
    pose = odometry.pose.pose
    transform.header.stamp = odometry.header.stamp
    transform.header.frame_id, transform.child_frame_id = odom_frame, base_frame
    transform.transform.translation.x, transform.transform.translation.y = pose.position.x, pose.position.y
    transform.transform.rotation = pose.orientation


def fill_image(message: Any, pixels: npt.NDArray[Any], encoding: str) -> None:
    """Write size and encoding of an (H, W) or (H, W, C) image into a sensor_msgs/Image; not its data."""
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.step = pixels[0].nbytes


@dataclass(frozen=True, slots=True)
class PinholeMatrices:
    """Size and matrices of a camera without distortion, as sensor_msgs/CameraInfo has them."""

    width: int
    height: int
    k: list[float]
    """Intrinsic matrix, row-major, pixels."""
    p: list[float]
    """Projection matrix, row-major, pixels."""
    r: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """Rectification matrix."""
    d: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """Distortion of the model `plumb_bob`."""

    @classmethod
    def of(cls, camera: Camera, turns: int = 0) -> "PinholeMatrices":
        """Return the matrices of a camera that is mounted `turns` quarter turns anticlockwise."""
        focal, (cx, cy) = camera.focal_px, camera.center_px
        width, height = camera.width, camera.height
        if turns % 2:
            width, height, cx, cy = height, width, cy, cx
        k = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
        return cls(width, height, k, [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0])


def turned(pixels: npt.NDArray[Any], turns: int) -> npt.NDArray[Any]:
    """Return an upright image as a camera sees it that is mounted `turns` quarter turns anticlockwise."""
    return np.ascontiguousarray(np.rot90(pixels, turns))


_REPORTED = ("completed", "failure", "corrections", "duration_s", "sensor_lost")
"""Fields of a result that the node on the robot knows; the client measures the motion."""


def result_to_json(result: MotionResult) -> dict[str, Any]:
    """Return what the mover reports of a movement, as JSON values."""
    return {name: getattr(result, name) for name in _REPORTED}
