"""The check-up of a base that leans: its attitude, and the mount of its camera without it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from vsnbench.robots.checkup.mount import mount_on
from vsnbench.robots.checkup.odometry import attitude_results, attitudes_in, last_attitude
from vsnbench.robots.checkup.result import Health
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.sensing.images.rectifier import Rectifier
from vsnbench.values.camera import Camera
from vsnbench.values.pose import LEVEL, Attitude

CAMERA = Camera(
    width=160, height=120, horizontal_fov_deg=69, mount_height_m=0.43, mount_forward_m=0.3, tilt_deg=-15, roll_deg=1.0
)
LEANING = Attitude(math.radians(-2), math.radians(3))


def floor_m(attitude: Attitude) -> np.ndarray:
    """Return the depth (H, W) that the camera sees of a floor, on a base with an attitude."""
    rows, columns = np.indices((CAMERA.height, CAMERA.width))
    (cx, cy) = CAMERA.center_px
    across, down = (columns - cx) / CAMERA.focal_px, (rows - cy) / CAMERA.focal_px
    upward = (np.stack([across, down, np.ones_like(across)], -1) @ CAMERA.axes(attitude))[..., 2]
    with np.errstate(divide="ignore"):
        depth_m = np.where(upward < 0, CAMERA.on(attitude).mount_height_m / -upward, np.nan)
    return np.where(depth_m < 5, depth_m, np.nan).astype(np.float32)


@pytest.mark.parametrize("attitude", [LEVEL, LEANING])
def test_the_mount_is_measured_without_the_lean_of_the_body(attitude: Attitude) -> None:
    seen_m = Rectifier(CAMERA, None, 0, attitude).depth(floor_m(attitude))
    height, tilt, roll = mount_on(seen_m, CAMERA, attitude)
    assert height.measured.value == pytest.approx(0.43, abs=0.003)
    assert tilt.measured.value == pytest.approx(-15, abs=0.1)
    assert roll.measured.value == pytest.approx(1, abs=0.1)


def test_without_the_attitude_the_lean_looks_like_a_tilted_mount() -> None:
    _, tilt, _ = mount_on(Rectifier(CAMERA, None).depth(floor_m(LEANING)), CAMERA)
    assert tilt.exceeds


def test_the_attitude_at_rest_is_reported_or_why_there_is_none() -> None:
    interface = load_profile("turtlebot4").interface
    assert interface is not None
    names = Ros2Interface.model_validate(interface.model_dump() | {"attitude": {"topic": "odom"}}).resolved()
    turns = [SimpleNamespace(x=0.0, y=math.sin(angle), z=0.0, w=math.cos(angle)) for angle in (0.01, 0.02)]
    messages = [SimpleNamespace(pose=SimpleNamespace(pose=SimpleNamespace(orientation=turn))) for turn in turns]
    measured = attitudes_in(names, messages, float)
    (result,) = attitude_results(measured)
    assert (result.health, result.seen) == (Health.OK, "roll 0.0° to 0.0°, pitch 1.1° to 2.3°")
    assert last_attitude(measured).pitch_rad == pytest.approx(0.04)
    turns[1].w = 3.0
    measured = attitudes_in(names, messages, float)
    (result,) = attitude_results(measured)
    assert result.health is Health.FAILED
    assert "not a unit quaternion" in result.seen
    assert last_attitude(measured).pitch_rad == pytest.approx(0.02)
    assert attitudes_in(names.model_copy(update={"attitude": None}), messages, float) == []
