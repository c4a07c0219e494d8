"""Images of a tilted camera with a lens over a bare floor, and of the same to the left, for ROS 1 and ROS 2."""

import math
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np

from vsnbench.sensing.images.intrinsics import Intrinsics

WIDTH, HEIGHT = 160, 120
HEIGHT_M, TILT_DEG, ROLL_DEG, FOV_DEG = 0.50, -5.0, 3.0, 58.0
FOCAL_PX = WIDTH / 2 / math.tan(math.radians(FOV_DEG / 2))
LENS = Intrinsics(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, 84.0, 57.0, (0.08, -0.1, 0.0, 0.0, 0.0), "plumb_bob")
K = [FOCAL_PX, 0.0, 84.0, 0.0, FOCAL_PX, 57.0, 0.0, 0.0, 1.0]
FISHEYE_FOV_DEG = 150.0
FISHEYE_FOCAL_PX = WIDTH / 2 / math.radians(FISHEYE_FOV_DEG / 2)
FISHEYE_K = [FISHEYE_FOCAL_PX, 0.0, 79.5, 0.0, FISHEYE_FOCAL_PX, 59.5, 0.0, 0.0, 1.0]
"""An ideal equidistant lens: radius is focal length times angle, without coefficients."""
PROFILE = """\
# of the tests
name: floor-base
title: A base over a bare floor
base: {{radius_m: 0.177, height_m: 0.6, mass_kg: 6.3, track_m: 0.23, wheel_radius_m: 0.035, max_linear_m_s: 0.7,
  max_angular_rad_s: 3.1, odometry_rate_hz: 50}}
camera:
  width: 160
  height: 120
  horizontal_fov_deg: {fov_deg} # from the data sheet
  mount_height_m: 0.60 # measured by eye
  depth_min_m: 0.3
cameras:
  left: {{width: 160, height: 120, horizontal_fov_deg: 58, mount_height_m: 0.55, mount_left_m: 0.1, yaw_deg: 90}}
interface: {{kind: {kind}, color: {color}, depth: {depth}, color_info: /camera/color/camera_info,
  depth_info: {depth_info}, depth_frames: 5, cameras: {{left: {{color: /camera_left/color/image_raw,
  color_info: /camera_left/color/camera_info, depth: /camera_left/depth/image_raw,
  depth_info: /camera_left/depth/camera_info}}}}}}
"""


def write_profile(path: Path, kind: str, **fields: Any) -> Path:
    """Write a profile of the base, with other topics or another field of view."""
    usual = {
        "fov_deg": 60,
        "color": "/camera/color/image_raw",
        "depth": "/camera/depth/image_raw",
        "depth_info": "/camera/depth/camera_info",
    }
    path.write_text(PROFILE.format(kind=kind, **usual | fields))
    return path


def depth_mm() -> Any:
    """Return (H, W) uint16 millimetres of the floor in front of a wall at 4 m, through the lens."""
    row, column = np.indices((HEIGHT, WIDTH)).reshape(2, -1).astype(np.float64)
    pixels = np.column_stack([column, row])[:, None]
    rays = cv2.undistortPoints(pixels, np.array(K).reshape(3, 3), np.array(LENS.distortion))[:, 0]
    roll, tilt = math.radians(ROLL_DEG), math.radians(TILT_DEG)
    down = math.sin(roll) * rays[:, 0] + math.cos(roll) * rays[:, 1]
    rise = math.sin(tilt) - math.cos(tilt) * down
    with np.errstate(divide="ignore"):
        floor_m = np.where(rise < 0, -HEIGHT_M / rise, np.inf)
    return np.rint(1000 * np.minimum(floor_m, 4.0)).astype(np.uint16).reshape(HEIGHT, WIDTH)


def compressed() -> dict[str, SimpleNamespace]:
    """Return what compressed topics carry: format and data."""
    measured = depth_mm()
    a = 100.0 * 101.0
    b = 1.0 - a / 10.0
    inverse = np.rint(a / (measured / 1000) + b).astype(np.uint16)
    png = bytes(cv2.imencode(".png", inverse)[1])
    jpeg = bytes(cv2.imencode(".jpg", np.full((HEIGHT, WIDTH, 3), 90, np.uint8))[1])
    return {
        "/camera/depth/image_raw/compressedDepth": SimpleNamespace(
            format="32FC1; compressedDepth png", data=struct.pack("<iff", 0, a, b) + png
        ),
        "/camera/rvl/image_raw/compressedDepth": SimpleNamespace(
            format="16UC1; compressedDepth rvl", data=struct.pack("<iff", 0, 0, 0) + b"\0" * 64
        ),
        "/camera/color/image_raw/compressed": SimpleNamespace(format="rgb8; jpeg compressed bgr8", data=jpeg),
        "/camera/unnamed": SimpleNamespace(format="rgb8; jpeg compressed bgr8", data=jpeg),
    }
