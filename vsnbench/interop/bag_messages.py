"""ROS 1 and ROS 2 messages for bags, created with rosbags' type stores; ROS is not required."""

import math
from functools import cache
from typing import Any

import numpy as np

from vsnbench.errors import UsageError
from vsnbench.installation import command_to_add
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

TF = "tf2_msgs/msg/TFMessage"
CAMERA_FRAME = "camera_color_optical_frame"
BASE_FRAME = "base_footprint"

Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""


@cache
def type_store(*, ros2: bool = False) -> Any:
    """Return the types of ROS Noetic and of its tf2, or of ROS 2 Humble.

    Raises:
        UsageError: rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise UsageError("bags require the library rosbags", advice=command_to_add("bags")) from error
    if ros2:
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
    return store


class Messages:
    """Creates messages; times are in nanoseconds since 1970."""

    def __init__(self, store: Any) -> None:
        """Create messages of the types in a store, see `type_store`."""
        self._types = store.types
        self._has_sequence = "seq" in self._types["std_msgs/msg/Header"].__annotations__

    def text(self, text: str) -> Any:
        """Return a std_msgs/String."""
        return self._types["std_msgs/msg/String"](text)

    def jpeg(self, number: int, time_ns: int, data: bytes, frame: str = CAMERA_FRAME) -> Any:
        """Return a colour image with the recorded compression."""
        header = self._header(number, time_ns, frame)
        return self._types["sensor_msgs/msg/CompressedImage"](header, "jpeg", np.frombuffer(data, np.uint8))

    def depth(self, number: int, time_ns: int, depth_mm: Any, frame: str = CAMERA_FRAME) -> Any:
        """Return a depth image (H, W) of uint16 millimetres."""
        height, width = depth_mm.shape
        data = np.ascontiguousarray(depth_mm, dtype="<u2").view(np.uint8).ravel()
        header = self._header(number, time_ns, frame)
        return self._types["sensor_msgs/msg/Image"](header, height, width, "16UC1", 0, width * 2, data)

    def camera_info(self, number: int, time_ns: int, camera: Camera, frame: str = CAMERA_FRAME) -> Any:
        """Return the calibration of an ideal pinhole camera of the profile."""
        focal, (cx, cy) = camera.focal_px, camera.center_px
        return self._types["sensor_msgs/msg/CameraInfo"](
            self._header(number, time_ns, frame),
            camera.height,
            camera.width,
            "plumb_bob",
            np.zeros(5),
            np.array([focal, 0, cx, 0, focal, cy, 0, 0, 1], np.float64),
            np.eye(3).ravel(),
            np.array([focal, 0, cx, 0, 0, focal, cy, 0, 0, 0, 1, 0], np.float64),
            0,
            0,
            self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
        )

    def odometry(self, number: int, time_ns: int, pose: Pose) -> Any:
        """Return odometry relative to the start of the episode."""
        nothing = self._types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        unknown = np.zeros(36)
        there = self._types["geometry_msgs/msg/Pose"](
            self._types["geometry_msgs/msg/Point"](pose.x_m, pose.y_m, 0.0), self._quaternion(_about_z(pose))
        )
        twist = self._types["geometry_msgs/msg/Twist"](nothing, nothing)
        return self._types["nav_msgs/msg/Odometry"](
            self._header(number, time_ns, "odom"),
            BASE_FRAME,
            self._types["geometry_msgs/msg/PoseWithCovariance"](there, unknown),
            self._types["geometry_msgs/msg/TwistWithCovariance"](twist, unknown),
        )

    def base_in_odometry(self, number: int, time_ns: int, pose: Pose) -> Any:
        """Return the transform from `odom` to the base."""
        return self._transform(number, time_ns, "odom", BASE_FRAME, (pose.x_m, pose.y_m, 0.0), _about_z(pose))

    def odometry_in_site(self, time_ns: int, start: Pose) -> Any:
        """Return the transform from the site (`map`) to the start of the episode, the origin of `odom`."""
        return self._transform(0, time_ns, "map", "odom", (start.x_m, start.y_m, 0.0), _about_z(start))

    def camera_on_base(self, time_ns: int, camera: Camera, frame: str = CAMERA_FRAME) -> Any:
        """Return the transform from the base to a camera's optical frame: x right, y down, z forward."""
        where = camera.mount_forward_m, camera.mount_left_m, camera.mount_height_m
        return self._transform(0, time_ns, BASE_FRAME, frame, where, optical_turn(camera.tilt_deg, camera.yaw_deg))

    def _transform(
        self, number: int, time_ns: int, parent: str, child: str, where: tuple[float, float, float], turn: Quaternion
    ) -> Any:
        shift = self._types["geometry_msgs/msg/Vector3"](*where)
        transform = self._types["geometry_msgs/msg/Transform"](shift, self._quaternion(turn))
        header = self._header(number, time_ns, parent)
        return self._types[TF]([self._types["geometry_msgs/msg/TransformStamped"](header, child, transform)])

    def _header(self, number: int, time_ns: int, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
        header = self._types["std_msgs/msg/Header"]
        return header(number, stamp, frame) if self._has_sequence else header(stamp, frame)

    def _quaternion(self, turn: Quaternion) -> Any:
        return self._types["geometry_msgs/msg/Quaternion"](*turn)


def optical_turn(tilt_deg: float, yaw_deg: float = 0.0) -> Quaternion:
    """Return the rotation from a base (x forward, y left, z up) to the optical frame of a turned and tilted camera."""
    half_rad = -math.radians(tilt_deg) / 2
    s, c = math.sin(half_rad) / 2, math.cos(half_rad) / 2
    # (0, sin, 0, cos), the pitch, times (-1/2, 1/2, -1/2, 1/2), the change of axes.
    x, y, z, w = -c - s, c + s, -c + s, c - s
    half_yaw_rad = math.radians(yaw_deg) / 2
    sin, cos = math.sin(half_yaw_rad), math.cos(half_yaw_rad)
    return (cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z)


def _about_z(pose: Pose) -> Quaternion:
    return (0.0, 0.0, math.sin(pose.heading_rad / 2), math.cos(pose.heading_rad / 2))
