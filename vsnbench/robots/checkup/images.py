"""Checks of a robot's images: format, size, depth, freezing, calibration, mount of the camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vsnbench.errors import ImageError
from vsnbench.protocol.depth_evidence import MIN_HIDDEN_CELLS, evidence_pixels
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.robots.checkup.mount import mount_results
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.ros.common.interface import CameraTopics, RosInterface
from vsnbench.sensing.images.camera_images import DepthImage, decode_color, decode_depth, median_depth_m, share_invalid
from vsnbench.sensing.images.compressed_images import is_compressed
from vsnbench.sensing.images.depth_range import WRONG_UNIT, range_fault
from vsnbench.sensing.images.intrinsics import FOV_SHARE, Calibration, CalibrationError, Intrinsics
from vsnbench.sensing.images.rectifier import is_of_own_size, rectifier_of
from vsnbench.sensing.images.regions import Region, invalid_region
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.pose import LEVEL, Attitude
from vsnbench.values.robot_profile import RobotProfile

MAX_HOLES = 0.4
"""A larger share of invalid depth is a warning."""
HOLES_ADVICE = "check for close objects, sunlight and a dirty lens"
_LARGE_REGION = 0.25
"""A smaller region may be an object in front of the robot; `--move` tells them apart."""
Read = Callable[[str, bytes], Any]
"""Returns a serialized message of a type such as `sensor_msgs/Image`."""


def image_type(topic: str) -> str:
    """Return the message type of an image topic, by image_transport's naming."""
    return "sensor_msgs/CompressedImage" if is_compressed(topic) else "sensor_msgs/Image"


def image_topics(names: RosInterface) -> dict[str, str]:
    """Return the topics of images: `colour` and `depth` of the main camera, `left colour` and so on of the others."""
    topics = {"colour": names.color, "depth": names.depth}
    for role, its in names.cameras.items():
        topics |= {f"{role} colour": its.color, f"{role} depth": its.depth}
    return {what: topic for what, topic in topics.items() if topic}


def type_advice(wanted: str, found: str) -> str:
    """Return the advice for a topic with another type than the profile's."""
    if found == "sensor_msgs/CompressedImage":
        return "remap it: the topic of a compressed image must end in /compressed or /compressedDepth"
    return f"the profile needs {wanted}"


def image_results(
    profile: RobotProfile,
    messages: dict[str, TopicMessages],
    read: Read,
    turns: int = 0,
    attitude: Attitude = LEVEL,
) -> Iterator[CheckResult]:
    """Report whether the received images fit the profile.

    Args:
        profile: profile of the robot.
        messages: received messages by topic.
        read: see Read.
        turns: number of clockwise quarter turns that set an image upright.
        attitude: attitude of the base, which stands still.
    """
    names = interface_of(profile)
    for role, camera in {CameraRole.FRONT: profile.camera, **profile.cameras}.items():
        if role not in names.camera_topics:
            seen = "the profile names no topics of it: models that ask for it are refused"
            yield CheckResult(
                f"{role} camera", Health.WARNING, seen, f"name them in interface.cameras: {{{role}: ...}}"
            )
            continue
        topics, prefix = names.camera_topics[role], "" if role is CameraRole.FRONT else f"{role} "
        for result in _camera_results(profile, camera, topics, messages, read, turns, attitude):
            yield result if result.what.startswith("/") else replace(result, what=f"{prefix}{result.what}")


def _camera_results(
    profile: RobotProfile,
    camera: Camera,
    topics: CameraTopics,
    messages: dict[str, TopicMessages],
    read: Read,
    turns: int,
    attitude: Attitude,
) -> Iterator[CheckResult]:
    """Report whether the images of one camera fit the profile."""
    is_main = camera is profile.camera
    frames: list[DepthImage] = []
    calibrations: dict[str, Calibration] = {}
    for info, topic in ((topics.color_info, topics.color), (topics.depth_info, topics.depth)):
        if info and topic and messages[info].messages:
            calibrations[topic] = _calibration(read, messages[info].messages[-1], topic)
    of_own_size = False
    for what, topic in (("colour image", topics.color), ("depth image", topics.depth)):
        if not topic or not messages[topic].messages:
            continue
        try:
            newest = messages[topic].messages[-interface_of(profile).depth_frames :]
            images = [_message(read, topic, data) for data in newest]
            if what == "depth image":
                decoded: list[Any] = [decode_depth(image) for image in images]
            else:
                decoded = [decode_color(images[-1])]
        except ImageError as error:
            yield CheckResult(
                what, Health.FAILED, error.statement, error.advice or "set the format in the camera driver"
            )
            continue
        height, width = decoded[-1].shape[:2][:: -1 if turns % 2 else 1]
        encoding = getattr(images[-1], "encoding", "") or images[-1].format
        seen = f"{encoding}, {width}x{height}"
        if what == "depth image" and is_main:
            size = decoded[-1].shape[::-1]
            if of_own_size := is_of_own_size(calibrations.get(topic), camera, size, turns):
                seen += f"; resampled to the colour image's {camera.width}x{camera.height} by both calibrations"
                width, height = camera.width, camera.height
        if (width, height) != (camera.width, camera.height):
            advice = "set the mode of the driver, or the camera of the profile"
            yield CheckResult(what, Health.FAILED, f"{seen}; the profile has {camera.width}x{camera.height}", advice)
            continue
        yield CheckResult(what, Health.OK, seen)
        if what == "depth image":
            frames = decoded
    if frames and of_own_size:
        registered = rectifier_of(calibrations[topics.depth], camera, "", turns, of_own_size=True)
        yield from _depth_results(profile, [registered.labels(frame) for frame in frames])
    elif frames:
        upright = [np.rot90(frame, -turns) for frame in frames]
        yield from _depth_results(profile, upright) if is_main else _further_depth_results(camera, upright)
    for info, topic in ((topics.color_info, topics.color), (topics.depth_info, topics.depth)):
        if topic in calibrations and not (of_own_size and topic == topics.depth):
            yield _calibration_result(camera, info, topic, calibrations[topic], turns)
    if frames:
        median_m = median_depth_m(frames, camera.depth_min_m, camera.depth_max_m)
        try:
            calibration = calibrations.get(topics.depth)
            rectifier = rectifier_of(calibration, camera, "", turns, attitude, of_own_size=of_own_size)
        except CalibrationError:
            return
        yield from mount_results(rectifier.depth(median_m), camera, attitude)


def _further_depth_results(camera: Camera, frames: list[DepthImage]) -> Iterator[CheckResult]:
    """Report range and invalid share of the upright depth images of a camera by which vsnbench does not drive."""
    if fault := range_fault(frames[-1], camera):
        yield CheckResult("depth range", Health.FAILED, fault, WRONG_UNIT)
    invalid = share_invalid(median_depth_m(frames, camera.depth_min_m, camera.depth_max_m))
    seen = f"{invalid:.0%} of the pixels after the median of {len(frames)}"
    if invalid > MAX_HOLES:
        yield CheckResult("depth invalid", Health.WARNING, seen, HOLES_ADVICE)
    else:
        yield CheckResult("depth invalid", Health.OK, seen)


def _depth_results(profile: RobotProfile, frames: list[DepthImage]) -> Iterator[CheckResult]:
    """Report range and invalid share of upright depth images, as the depth guard needs them."""
    camera = profile.camera
    if fault := range_fault(frames[-1], camera):
        yield CheckResult("depth range", Health.FAILED, fault, WRONG_UNIT)
    before = share_invalid(median_depth_m(frames[-1:], camera.depth_min_m, camera.depth_max_m))
    depth_m = median_depth_m(frames, camera.depth_min_m, camera.depth_max_m)
    after, (height, width) = share_invalid(depth_m), depth_m.shape
    seen = f"{before:.0%} of the pixels in one image, {after:.0%} after the median of {len(frames)}"
    evidence = evidence_pixels(camera, width, height, profile.base.radius_m, DepthGuard()).read(depth_m, camera)
    if evidence.is_blind:
        seen += f"; {evidence.valid_share:.0%} of those that show the way ahead are valid: no forward move is possible"
        advice = f"turn the robot to free space ({camera.depth_min_m:g} m is too near), and check its depth"
        yield CheckResult("depth invalid", Health.FAILED, seen, advice)
    elif evidence.hides_something and (region := _unmeasured(frames)).share >= _LARGE_REGION:
        seen += f"; {region.text} is always invalid: no forward move is possible"
        yield CheckResult("depth invalid", Health.FAILED, seen, _region_advice(profile))
    elif evidence.hides_something or after > MAX_HOLES:
        yield CheckResult("depth invalid", Health.WARNING, seen, HOLES_ADVICE)
    else:
        yield CheckResult("depth invalid", Health.OK, seen)


def turned_results(
    profile: RobotProfile, before: Mapping[str, Any], after: Mapping[str, Any], turns: int = 0
) -> Iterator[CheckResult]:
    """Report whether the camera's images changed with a turn of the robot.

    Args:
        profile: profile of the robot.
        before: `colour` and `depth` message from before the turn; those of further cameras are `left colour` and so on.
        after: the same from after it.
        turns: number of clockwise quarter turns that set an image upright.
    """
    for what in sorted(before.keys() & after.keys()):
        one, other = bytes(before[what].data), bytes(after[what].data)
        if one != other:
            yield CheckResult(f"{what} changes", Health.OK, "the image after the turn differs")
        elif any(one):  # depth without a measurement has a result of its own
            seen = "the images before and after the turn are identical: the camera is frozen"
            yield CheckResult(f"{what} changes", Health.FAILED, seen, "restart the driver of the camera")
    if "depth" in before and "depth" in after:
        yield from _region_results(profile, [before["depth"], after["depth"]], turns)


def _region_results(profile: RobotProfile, messages: Sequence[Any], turns: int) -> Iterator[CheckResult]:
    """Report a region without depth in all of some images, between which the robot has turned."""
    camera = profile.camera
    try:
        frames = [np.rot90(decode_depth(message), -turns) for message in messages]
        depths = [median_depth_m([frame], camera.depth_min_m, camera.depth_max_m) for frame in frames]
    except (ImageError, ValueError):
        return  # `image_results` has reported it
    height, width = depths[0].shape
    if (width, height) != (camera.width, camera.height):
        return  # depth of another size, whose pixels show other directions
    cells = evidence_pixels(camera, width, height, profile.base.radius_m, DepthGuard())
    hidden = np.logical_and.reduce([cells.read(depth_m, camera).hidden for depth_m in depths])
    region = _unmeasured(frames)
    if np.count_nonzero(hidden) >= MIN_HIDDEN_CELLS and region.share:
        seen = f"{region.text} is always invalid, before and after the turn: no forward move is possible"
        yield CheckResult("depth region", Health.FAILED, seen, _region_advice(profile))


def _region_advice(profile: RobotProfile) -> str:
    near_m = profile.camera.depth_min_m
    return f"turn the robot to free space ({near_m:g} m is too near), and remove what covers the lens or is in its view"


def _unmeasured(frames: Sequence[DepthImage]) -> Region:
    """Return the region in which no raw image has a measurement; beyond the range is one."""
    return invalid_region(~np.logical_or.reduce([frame > 0 for frame in frames]))


def _message(read: Read, topic: str, data: bytes) -> Any:
    """Return the message of an image topic.

    Raises:
        ImageError: the data is not such a message.
    """
    kind = image_type(topic)
    try:
        return read(kind, data)
    except Exception as error:
        raise ImageError(f"a message on {topic} is not a {kind}") from error


def _calibration(read: Read, data: bytes, topic: str) -> Calibration:
    try:
        return Intrinsics.of(read("sensor_msgs/CameraInfo", data), topic)
    except CalibrationError as error:
        return error


def _calibration_result(
    camera: Camera,
    info: str,
    topic: str,
    calibration: Calibration,
    turns: int,
) -> CheckResult:
    if calibration is None:
        return CheckResult(info, Health.WARNING, "not calibrated (K is zero)", "the profile's field of view is used")
    try:
        rectifier = rectifier_of(calibration, camera, topic, turns)
    except CalibrationError as error:
        return CheckResult(info, Health.FAILED, error.statement, error.advice)
    assert isinstance(calibration, Intrinsics)  # noqa: S101  # rectifier_of raises errors
    fov_deg, wanted_deg = calibration.horizontal_fov_deg(turns), camera.horizontal_fov_deg
    moved = f"; images are rectified, by {rectifier.moved_px:.0f} px at most" if rectifier.resamples else ""
    if calibration.is_fisheye and fov_deg > wanted_deg:
        seen = (
            f"fisheye lens with a field of view of {fov_deg:.1f}°; images are cropped to the profile's {wanted_deg:g}°"
        )
        return CheckResult(info, Health.OK, seen)
    if abs(fov_deg - wanted_deg) > FOV_SHARE * wanted_deg:
        return CheckResult(
            info,
            Health.WARNING,
            f"field of view {fov_deg:.1f}°; the profile has {wanted_deg:g}°{moved}",
            f"set horizontal_fov_deg: {fov_deg:.1f} of the camera in your profile",
        )
    return CheckResult(info, Health.OK, f"field of view {fov_deg:.1f}°{moved}")
