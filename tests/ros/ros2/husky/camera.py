"""The depth camera of the Husky: PyBullet's CPU renderer in a process of its own, and a ROS 2 node."""

import array
import math
import os
import time
from multiprocessing.sharedctypes import SynchronizedArray
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import rclpy
from builtin_interfaces.msg import Time
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, Image

from tests.ros.ros2.husky import world

WIDTH, HEIGHT, FIELD_OF_VIEW_DEG = 160, 120, 70.0
MOUNT_M = (0.35, 0.0, 0.60)
RATE_HZ = 8.0
RANGE_M = (0.3, 8.0)
_NEAR_M, _FAR_M = 0.1, 12.0
_FOCAL_PX = WIDTH / 2 / math.tan(math.radians(FIELD_OF_VIEW_DEG / 2))
_CENTER_PX = (WIDTH / 2, HEIGHT / 2 - 1)
"""Principal point of the renderer; pixel (0, 0) has its centre at (0, 0)."""


def stamp_of(time_s: float) -> Time:
    nanoseconds = round(time_s * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


class Renderer:
    """Renders colour and depth in a copy of the room, without the robot, whose body is below the field of view."""

    def __init__(self, site: Path) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        world.build(site, self._client)
        upright_deg = math.degrees(2 * math.atan(HEIGHT / 2 / _FOCAL_PX))
        self._projection = pybullet.computeProjectionMatrixFOV(upright_deg, WIDTH / HEIGHT, _NEAR_M, _FAR_M)

    def render(self, position: Any, orientation: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return colour (H, W, 3) and depth (H, W) in millimetres, 0 outside of the range, from a pose of the base."""
        to_world = np.reshape(pybullet.getMatrixFromQuaternion(orientation), (3, 3))
        eye = np.asarray(position) + to_world @ MOUNT_M
        view = pybullet.computeViewMatrix(eye, eye + to_world[:, 0], to_world[:, 2])
        _, _, color, depth, _ = pybullet.getCameraImage(
            *(WIDTH, HEIGHT, view, self._projection),
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        share = np.reshape(depth, (HEIGHT, WIDTH)).astype(np.float64)
        depth_m = _FAR_M * _NEAR_M / (_FAR_M - (_FAR_M - _NEAR_M) * share)
        depth_m[(depth_m < RANGE_M[0]) | (depth_m > RANGE_M[1])] = 0.0
        pixels = np.reshape(color, (HEIGHT, WIDTH, 4))[..., :3].astype(np.uint8)
        return pixels, np.rint(1000 * depth_m).astype(np.uint16)


def serve(site: Path, shared: "SynchronizedArray[float]") -> None:
    """Publish images from the pose in `shared` (time, position, quaternion) until the parent process ends."""
    parent, renderer = os.getppid(), Renderer(site)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("realsense")
    publishers = [
        (
            node.create_publisher(Image, f"camera/{part}/image_raw", qos_profile_sensor_data),
            node.create_publisher(CameraInfo, f"camera/{part}/camera_info", qos_profile_sensor_data),
        )
        for part in ("color", "depth")
    ]
    due_s = time.monotonic()
    while os.getppid() == parent:
        time.sleep(max(0.0, due_s - time.monotonic()))
        due_s = max(due_s, time.monotonic() - 1 / RATE_HZ) + 1 / RATE_HZ
        with shared.get_lock():
            stamp_s, *pose = shared
        pictures = renderer.render(pose[:3], pose[3:])
        for (images, infos), pixels, encoding in zip(publishers, pictures, ("rgb8", "16UC1"), strict=True):
            images.publish(_image(pixels, encoding, stamp_s))
            infos.publish(_info(stamp_s))


def _image(pixels: np.ndarray, encoding: str, stamp_s: float) -> Image:
    image = Image(height=HEIGHT, width=WIDTH, encoding=encoding, step=pixels[0].nbytes)
    image.header.stamp, image.header.frame_id = stamp_of(stamp_s), "camera_color_optical_frame"
    image.data = array.array("B", pixels.tobytes())
    return image


def _info(stamp_s: float) -> CameraInfo:
    (u, v), f = _CENTER_PX, _FOCAL_PX
    info = CameraInfo(height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", d=[0.0] * 5)
    info.header.stamp, info.header.frame_id = stamp_of(stamp_s), "camera_color_optical_frame"
    info.k = [f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]
    info.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.p = [f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info
