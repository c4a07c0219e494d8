"""Calibration of the camera mount in a robot profile."""

import io
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError
from vsnbench.files.atomic import write_atomic
from vsnbench.robots.checkup.mount import FREE_FLOOR_ADVICE, MountDifference, mount_on
from vsnbench.robots.ros.link import connect
from vsnbench.ros.common.interface import CameraTopics
from vsnbench.ros.common.robot_link import MOST_FURTHER_IMAGES, RobotLink
from vsnbench.sensing.images.camera_images import Stamped, decode_depth, median_depth_m
from vsnbench.sensing.images.floor_plane import Measured, NoFloorError
from vsnbench.sensing.images.intrinsics import FOV_SHARE, Intrinsics
from vsnbench.sensing.images.rectifier import is_of_own_size, rectifier_of
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.pose import LEVEL, Attitude
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

_PATIENCE_S = 20.0
_CALIBRATION_S = 5.0
_FOV_STD_DEG = 0.1
_DIGITS = {"mount_height_m": 3, "tilt_deg": 2, "roll_deg": 2, "horizontal_fov_deg": 2}


def corrections_of(differences: Mapping[str, MountDifference]) -> dict[str, float]:
    """Return new values of those fields whose error exceeds the uncertainty of the measurement."""
    return {
        name: round(difference.measured.value, _DIGITS[difference.field])
        for name, difference in differences.items()
        if abs(difference.measured.value - difference.profile) > difference.measured.std
    }


def calibrate(profile: RobotProfile) -> dict[str, MountDifference]:
    """Measure the mounts of the cameras by the floor, and read their fields of view from camera_info.

    The robot does not move and should have about 2 m of free floor in front of each camera. Further cameras without a
    depth topic are left out, with a warning.

    Returns:
        The measured quantities by field of the profile: `tilt_deg` of the main camera, `left.tilt_deg` of that to the
        left, and so on.

    Raises:
        RobotError: no images arrive, or they show no floor.
    """
    if not profile.interface or not getattr(profile.interface, "depth", ""):
        raise RobotError(
            f"robot profile {profile.name} has no depth topic",
            advice="set interface.depth: the mount is measured in depth images",
            code="no-depth",
        )
    link = connect(profile)
    measured: dict[str, MountDifference] = {}
    try:
        attitude = _attitude(link)
        for role, topics in link.names.camera_topics.items():
            camera = profile.camera if role is CameraRole.FRONT else profile.cameras[role]
            if not topics.depth:
                logger.warning("the %s camera has no depth topic: its mount is not measured", role)
                continue
            prefix = "" if role is CameraRole.FRONT else f"{role}."
            for difference in _calibrated(link, camera, topics, attitude):
                measured[f"{prefix}{difference.field}"] = difference
    except NoFloorError as error:
        raise RobotError(
            f"the mount of the {role} camera cannot be measured: {error}", advice=FREE_FLOOR_ADVICE, code="no-floor"
        ) from error
    finally:
        link.close()
    return measured


def _calibrated(
    link: RobotLink, camera: Camera, topics: CameraTopics, attitude: Attitude
) -> tuple[MountDifference, ...]:
    """Return the measured quantities of one camera.

    Raises:
        RobotError: no images arrive.
        NoFloorError: they show no floor.
    """
    fov = _field_of_view(link, camera, topics)
    if fov is not None:
        camera = camera.model_copy(update={"horizontal_fov_deg": fov.measured.value})
    differences = mount_on(_depth_m(link, camera, topics.depth, attitude), camera, attitude)
    return (*differences, *(() if fov is None else (fov,)))


def _attitude(link: RobotLink) -> Attitude:
    """Return the attitude in which the base stands; level for a profile without its source.

    Raises:
        RobotError: its source gives none.
    """
    source = link.names.attitude
    if source is None:
        return LEVEL
    attitudes = link.wait_for(lambda now: now.attitudes, _PATIENCE_S)
    if not attitudes:
        fault = link.snapshot().attitude_fault or f"no attitude on {source.topic} for {_PATIENCE_S:.0f} s"
        raise RobotError(fault, code="no-attitude")
    return attitudes[-1].payload


def _depth_m(link: RobotLink, camera: Camera, topic: str, attitude: Attitude) -> npt.NDArray[np.float32]:
    """Return the median of the robot's next depth images on a topic, rectified to `camera`.

    Raises:
        RobotError: no depth images arrive, or they do not fit the profile.
    """
    is_main = topic == link.names.depth
    frames = _last_depths(link, topic, link.names.depth_frames if is_main else MOST_FURTHER_IMAGES)
    decoded = [decode_depth(link.image(frame.payload)) for frame in frames]
    height, width = decoded[-1].shape[:: -1 if link.image_turns % 2 else 1]
    calibration = link.snapshot().calibrations.get(topic)
    of_own_size = is_main and is_of_own_size(calibration, camera, decoded[-1].shape[::-1], link.image_turns)
    if (width, height) != (camera.width, camera.height) and not of_own_size:
        raise RobotError(
            f"the depth image on {topic} is {width}x{height}, the profile has {camera.width}x{camera.height}",
            advice="set the mode of the camera driver, or the camera of the profile",
            code="wrong-image-size",
        )
    rectifier = rectifier_of(calibration, camera, topic, link.image_turns, attitude, of_own_size=of_own_size)
    return rectifier.depth(median_depth_m(decoded, camera.depth_min_m, camera.depth_max_m))


def _last_depths(link: RobotLink, topic: str, count: int) -> Sequence[Stamped[Any]]:
    """Return the last depth images on a topic, once there are as many.

    Raises:
        RobotError: they do not arrive.
    """

    def newest(now: RobotSnapshot) -> Sequence[Stamped[Any]]:
        images = now.depths if topic == link.names.depth else now.further.get(topic, ())
        return images[-count:] if len(images) >= count else ()

    frames = link.wait_for(newest, _PATIENCE_S)
    if not frames:
        raise RobotError(
            f"no depth images on {topic} for {_PATIENCE_S:.0f} s",
            advice="check the camera driver",
            code="no-image",
        )
    return frames


def _field_of_view(link: RobotLink, camera: Camera, topics: CameraTopics) -> MountDifference | None:
    """Return the field of view in camera_info, or None."""
    topic = topics.depth
    (newest,) = _last_depths(link, topic, 1)  # the camera has to be discovered first
    calibration = link.wait_for(lambda now: now.calibrations.get(topic), _CALIBRATION_S)
    if not isinstance(calibration, Intrinsics):
        if topics.depth_info and calibration is None:
            logger.warning(
                "no camera_info on %s within %g s: the field of view of the profile is used",
                *(topics.depth_info, _CALIBRATION_S),
            )
        return None
    if calibration.is_fisheye:
        return None  # the profile has the view that is cropped from the lens's
    if is_of_own_size(calibration, camera, decode_depth(link.image(newest.payload)).shape[::-1], link.image_turns):
        return None  # the profile has the view of the colour camera
    measured = Measured(calibration.horizontal_fov_deg(link.image_turns), _FOV_STD_DEG)
    limit = FOV_SHARE * camera.horizontal_fov_deg
    return MountDifference("horizontal_fov_deg", "°", measured, camera.horizontal_fov_deg, limit)


def write_corrections(source: Path, target: Path, corrections: dict[str, float]) -> None:
    """Write a profile with other values of its cameras, by the names of `calibrate`, to `target`; comments stay.

    Raises:
        RobotError: the profile has no camera, or the file cannot be written.
    """
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 4096
    content = yaml.load(source.read_text(encoding="utf-8"))
    if "camera" not in content:
        raise RobotError(f"{source} has no camera", code="no-camera")
    for name, value in corrections.items():
        role, _, field = name.rpartition(".")
        camera = content["cameras"][role] if role else content["camera"]
        camera[field] = value
    text = io.StringIO()
    yaml.dump(content, text)
    write_atomic(target, text.getvalue().encode(), RobotError)
