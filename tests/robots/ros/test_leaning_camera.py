"""Images of a leaning base are those of a level camera, whose tilt is that of their capture."""

import math
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vsnbench.errors import SensorLostError
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.camera import RosCamera
from vsnbench.ros.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.sensing.images.camera_images import MotionEnd
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Attitude, Pose
from vsnbench.values.robot_profile import RobotProfile

TILT_DEG = -10.0


def profile_of(attitude: dict[str, str] | None) -> RobotProfile:
    base = load_profile("turtlebot4")
    assert base.interface is not None
    camera = base.camera.model_copy(update={"width": 64, "height": 48, "tilt_deg": TILT_DEG})
    content = base.interface.model_dump() | {"color_info": "", "depth_info": "", "depth_frames": 3}
    interface = Ros2Interface.model_validate(content | ({} if attitude is None else {"attitude": attitude}))
    return base.model_copy(update={"camera": camera, "interface": interface})


class Link:
    """The reports of a robot that has sent what a test says."""

    has_labels = False
    image_turns = 0

    def __init__(self, profile: RobotProfile) -> None:
        self.names = ros2_interface(profile)
        self.reports = RobotReports(profile)

    def snapshot(self) -> RobotSnapshot:
        return self.reports.snapshot()

    def wait_for(self, condition: Callable[[RobotSnapshot], Any], timeout_s: float) -> Any:
        return self.reports.wait_for(condition, min(timeout_s, 0.01))

    def image(self, payload: Any) -> Any:
        return payload

    def send(self, stamp_s: float, attitude: Attitude | str | None) -> None:
        """Send colour, depth of 2 m and an attitude with one stamp."""
        if attitude is not None:
            self.reports.take_attitude(attitude, stamp_s)
        pictures = {"colors": ("rgb8", np.full((48, 64, 3), 90, np.uint8)), "depths": ("16UC1", 2000 + _RAMP)}
        for field, (encoding, pixels) in pictures.items():
            size = {"height": 48, "width": 64, "step": pixels[0].nbytes}
            image = SimpleNamespace(**size, encoding=encoding, is_bigendian=0, data=pixels.tobytes())
            self.reports.take_image(field, 6, image, stamp_s, f"/{field}", "/camera")


_RAMP = np.tile(np.arange(64, dtype=np.uint16), (48, 1))


def captured(attitudes: list[Attitude | str | None], source: dict[str, str] | None) -> Observation:
    """Return the observation of a robot that has sent images at these attitudes, one each tenth of a second."""
    link = Link(profile_of(source))
    camera = RosCamera(link, profile_of(source))  # type: ignore[arg-type]
    end = MotionEnd(9.0, time.monotonic() - 1)
    for number, attitude in enumerate(attitudes):
        link.send(10 + 0.2 * number, attitude)
    return camera.capture(end, lambda _: Pose(0.0, 0.0))


FROM_ODOMETRY = {"topic": "odom"}
DOWN = Attitude(math.radians(2), math.radians(4))


def test_the_camera_of_an_observation_has_the_tilt_of_its_capture_and_the_record_roll_and_pitch() -> None:
    seen = captured([Attitude(), Attitude(), DOWN], FROM_ODOMETRY)
    assert seen.camera.tilt_deg == pytest.approx(TILT_DEG - 4, abs=0.1)
    assert (seen.sensing["roll_deg"], seen.sensing["pitch_deg"]) == pytest.approx((2, 4), abs=0.13)
    assert seen.sensing["depth_frames"] == 1, "images at another attitude are in no median with the newest"
    assert seen.depth_m is not None
    assert np.nanmedian(seen.depth_m) == pytest.approx(2.03, abs=0.02)


def test_images_at_one_attitude_are_in_one_median() -> None:
    assert captured([DOWN] * 3, FROM_ODOMETRY).sensing["depth_frames"] == 3


def test_a_profile_without_a_source_takes_the_base_as_level() -> None:
    seen = captured([DOWN] * 3, None)
    assert seen.camera == profile_of(None).camera
    assert "pitch_deg" not in seen.sensing


@pytest.mark.parametrize(
    ("attitudes", "words"),
    [
        ([None] * 3, "odom has no attitude at the time of the image"),
        ([DOWN, None, None], "odom has no attitude at the time of the image"),
        ([DOWN, DOWN, "odom has no attitude: its orientation (0, 0, 0, 0) is not a unit quaternion"], "(0, 0, 0, 0)"),
    ],
)
def test_without_the_attitude_of_an_image_the_camera_is_lost(attitudes: Any, words: str) -> None:
    with pytest.raises(SensorLostError) as raised:
        captured(attitudes, FROM_ODOMETRY)
    assert raised.value.code == "no-attitude"
    assert words in str(raised.value)


def test_a_depth_image_in_motion_has_the_camera_of_its_capture() -> None:
    link = Link(profile_of(FROM_ODOMETRY))
    camera = RosCamera(link, profile_of(FROM_ODOMETRY))  # type: ignore[arg-type]
    for number, attitude in enumerate([Attitude(), DOWN]):
        link.send(10 + 0.2 * number, attitude)
    first, last = (camera.depth_of(image)[1].tilt_deg for image in link.snapshot().depths)
    assert (first, last) == pytest.approx((TILT_DEG, TILT_DEG - 4), abs=0.1)
