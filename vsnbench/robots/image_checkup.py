"""The images of a robot over ROS in a check-up: format, size, invalid depth, and the calibrated field of view."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.check_result import CheckResult, Health
from vsnbench.robots.interface_kinds import interface_of
from vsnbench.sensing.camera_images import (
    DepthImage,
    ImageError,
    decode_color,
    decode_depth,
    median_depth_m,
    share_invalid,
)
from vsnbench.sensing.heard import Heard

_FOV_SHARE = 0.03
_HOLES = 0.4


def image_results(
    profile: RobotProfile, heard: dict[str, Heard], read: Callable[[str, bytes], Any], turns: int = 0
) -> Iterator[CheckResult]:
    """Say how the images that were heard suit the profile.

    Args:
        profile: the robot.
        heard: what came, by topic.
        read: returns the message of a type, such as `sensor_msgs/Image`, in serialized bytes.
        turns: quarter turns that set an image upright.
    """
    names, camera = interface_of(profile), profile.camera
    frames: list[DepthImage] = []
    for what, topic in (("colour image", names.color), ("depth image", names.depth)):
        if not topic or not heard[topic].messages:
            continue
        images = [read("sensor_msgs/Image", data) for data in heard[topic].messages]
        try:
            if what == "depth image":
                frames = [decode_depth(image) for image in images[-names.depth_frames :]]
            else:
                decode_color(images[-1])
        except ImageError as error:
            yield CheckResult(what, Health.FAILED, error.statement, error.advice or "set the camera driver's format")
            continue
        size = (images[-1].width, images[-1].height)[:: -1 if turns % 2 else 1]
        wanted = (camera.width, camera.height)
        seen = f"{images[-1].encoding}, {size[0]}x{size[1]}"
        if size != wanted:
            advice = "set the driver's mode, or the profile's camera"
            yield CheckResult(what, Health.FAILED, f"{seen}; the profile says {wanted[0]}x{wanted[1]}", advice)
        else:
            yield CheckResult(what, Health.OK, seen)
    if frames:
        before = share_invalid(median_depth_m(frames[-1:], camera.depth_min_m, camera.depth_max_m))
        after = share_invalid(median_depth_m(frames, camera.depth_min_m, camera.depth_max_m))
        seen = f"{before:.0%} of the pixels in one image, {after:.0%} after the median of {len(frames)}"
        worse = after > _HOLES
        advice = "something close before the camera, sunlight, or a dirty lens?" if worse else ""
        yield CheckResult("depth invalid", Health.WARNING if worse else Health.OK, seen, advice)
    for topic in (names.color_info, names.depth_info):
        if topic and heard[topic].messages:
            yield _camera_info_result(profile, topic, read("sensor_msgs/CameraInfo", heard[topic].messages[-1]), turns)


def _camera_info_result(profile: RobotProfile, topic: str, info: Any, turns: int) -> CheckResult:
    focal_px = (info.K if hasattr(info, "K") else info.k)[0]
    if not focal_px:
        return CheckResult(topic, Health.WARNING, "not calibrated (K is zero)", "the profile's field of view is used")
    fov_deg = math.degrees(2 * math.atan((info.height if turns % 2 else info.width) / 2 / focal_px))
    wanted_deg = profile.camera.horizontal_fov_deg
    if abs(fov_deg - wanted_deg) > _FOV_SHARE * wanted_deg:
        return CheckResult(
            topic,
            Health.WARNING,
            f"field of view {fov_deg:.1f}°; the profile says {wanted_deg:g}°",
            f"set camera.horizontal_fov_deg: {fov_deg:.1f} in your profile",
        )
    return CheckResult(topic, Health.OK, f"field of view {fov_deg:.1f}°")
