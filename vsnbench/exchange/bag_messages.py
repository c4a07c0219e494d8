"""ROS 1 messages of a bag, made from plain values through rosbags' type store; no ROS is needed."""

import math
from functools import cache
from typing import Any

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose

TF = "tf2_msgs/msg/TFMessage"
CAMERA_FRAME = "camera_color_optical_frame"
BASE_FRAME = "base_footprint"

Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""


@cache
def type_store() -> Any:
    """Return Noetic's types and that of tf2, which is not among them."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
    return store


class Messages:
    """Makes messages; times are nanoseconds since 1970."""

    def __init__(self) -> None:
        self._types = type_store().types

    def text(self, text: str) -> Any:
        """Return a std_msgs/String."""
        return self._types["std_msgs/msg/String"](text)

    def jpeg(self, number: int, time_ns: int, data: bytes) -> Any:
        """Return a colour image, compressed as it was recorded."""
        import numpy as np

        header = self._header(number, time_ns, CAMERA_FRAME)
        return self._types["sensor_msgs/msg/CompressedImage"](header, "jpeg", np.frombuffer(data, np.uint8))

    def depth(self, number: int, time_ns: int, depth_mm: Any) -> Any:
        """Return a depth image (H, W) of uint16 millimetres."""
        import numpy as np

        height, width = depth_mm.shape
        data = np.ascontiguousarray(depth_mm, dtype="<u2").view(np.uint8).ravel()
        header = self._header(number, time_ns, CAMERA_FRAME)
        return self._types["sensor_msgs/msg/Image"](header, height, width, "16UC1", 0, width * 2, data)

    def camera_info(self, number: int, time_ns: int, camera: Camera) -> Any:
        """Return the calibration of the profile's ideal pinhole camera."""
        import numpy as np

        focal, (cx, cy) = camera.focal_px, camera.center_px
        return self._types["sensor_msgs/msg/CameraInfo"](
            self._header(number, time_ns, CAMERA_FRAME),
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
        import numpy as np

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
        """Return the transform from the site (`map`) to where the episode started, which `odom` counts from."""
        return self._transform(0, time_ns, "map", "odom", (start.x_m, start.y_m, 0.0), _about_z(start))

    def camera_on_base(self, time_ns: int, camera: Camera) -> Any:
        """Return the transform from the base to the camera's optical frame: x right, y down, z ahead."""
        where = camera.mount_forward_m, 0.0, camera.mount_height_m
        return self._transform(0, time_ns, BASE_FRAME, CAMERA_FRAME, where, optical_turn(camera.tilt_deg))

    def _transform(
        self, number: int, time_ns: int, parent: str, child: str, where: tuple[float, float, float], turn: Quaternion
    ) -> Any:
        shift = self._types["geometry_msgs/msg/Vector3"](*where)
        transform = self._types["geometry_msgs/msg/Transform"](shift, self._quaternion(turn))
        header = self._header(number, time_ns, parent)
        return self._types[TF]([self._types["geometry_msgs/msg/TransformStamped"](header, child, transform)])

    def _header(self, number: int, time_ns: int, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
        return self._types["std_msgs/msg/Header"](number, stamp, frame)

    def _quaternion(self, turn: Quaternion) -> Any:
        return self._types["geometry_msgs/msg/Quaternion"](*turn)


def optical_turn(tilt_deg: float) -> Quaternion:
    """Return the rotation from a base (x ahead, y left, z up) to the optical frame of a camera that is tilted up."""
    half_rad = -math.radians(tilt_deg) / 2
    s, c = math.sin(half_rad) / 2, math.cos(half_rad) / 2
    # (0, sin, 0, cos), the pitch, times (-1/2, 1/2, -1/2, 1/2), which turns the axes.
    return (-c - s, c + s, -c + s, c - s)


def _about_z(pose: Pose) -> Quaternion:
    return (0.0, 0.0, math.sin(pose.heading_rad / 2), math.cos(pose.heading_rad / 2))
