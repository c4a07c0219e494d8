"""Images of a robot over ROS after a motion: colour, median depth, labels."""

import hashlib
import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ImageError, SensorLostError
from vsnbench.robots.ros.further_cameras import FurtherCameras
from vsnbench.robots.ros.image_timing import MAX_SKEW_S, RateWatch, missing_images, not_ahead, observation_timeout_s
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.images.camera_images import (
    MatchedImages,
    MotionEnd,
    Stamped,
    beyond_range,
    decode_color,
    decode_depth,
    decode_labels,
    match_images,
    median_depth_m,
    share_invalid,
)
from vsnbench.sensing.images.depth_range import WRONG_UNIT, range_fault
from vsnbench.sensing.images.intrinsics import Calibration, CalibrationError, Intrinsics
from vsnbench.sensing.images.rectifier import Rectifier, is_of_own_size, rectifier_of
from vsnbench.sensing.odometry.attitude import attitude_at
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.observation import InstanceImage, Observation
from vsnbench.values.pose import LEVEL, Attitude, Pose
from vsnbench.values.robot_profile import RobotProfile

CAMERA_TIMEOUT_S = 3.0
"""Maximum age of the simulator's pose."""
_MAX_INVALID = 0.5
"""The unit of a depth image may be wrong if a larger share is invalid."""
_CALIBRATION_S = 2.0
"""Time for the first camera_info, which drivers publish with every image."""
_ATTITUDE_S = 0.3
"""Time for the attitude at an image, whose message may arrive after it."""
_SAME_ATTITUDE_RAD = math.radians(0.5)
"""Depth images of one median were taken at attitudes that differ less."""
_RECTIFIERS = 64
_STALE_S = 2.0
"""Age at which an image is no longer current."""
_PAIRED_SKEW_S, _PAIRING_S = 0.01, 0.05
"""Images of one moment, and the time for the second of two to arrive, while the robot drives."""


class RosCamera:
    """Waits for images taken after a motion, decodes and rectifies them.

    Raises:
        CalibrationError: in the constructor, if the camera_info contradicts the profile or cannot be used.
    """

    def __init__(self, link: RobotLink, profile: RobotProfile) -> None:
        self._link = link
        self._profile = profile
        self._names = link.names
        self.depth_frames = self._names.depth_frames if self._names.depth else 0
        """Number of depth images per median."""
        self._changing = threading.Lock()
        self._rates = RateWatch(link.names, profile.base.odometry_rate_hz)
        self._rectifiers: dict[tuple[str, Attitude], tuple[Calibration, bool, Rectifier]] = {}
        """Rectifier by topic and attitude, and the calibration that it is for; whether the images have a size of their
        own."""
        self.labelled = link.has_labels
        """Whether a simulator labels the images; read once, because a ROS master may die during an episode."""
        self._further = FurtherCameras(link, dict(profile.cameras), self._rectifier_of)
        self.roles = self._further.roles | {CameraRole.FRONT}
        """Roles of the cameras in its observations."""
        self._await_calibration()

    def _await_calibration(self) -> None:
        """Wait for the calibrations of the profile and check them.

        Without camera_info, the field of view of the profile is used.

        Raises:
            CalibrationError: a calibration cannot be used, or contradicts the profile.
        """
        names = self._names
        of_images = {names.color: names.color_info, names.depth: names.depth_info}
        wanted = [topic for topic, info in of_images.items() if topic and info]
        self._link.wait_for(lambda now: all(topic in now.calibrations for topic in wanted), _CALIBRATION_S)
        for topic in wanted:
            self._rectifier(topic, size=_size_of(self._link.snapshot().calibrations.get(topic)))

    def capture(self, end: MotionEnd, read_pose: Callable[[float], Pose]) -> Observation:
        """Return an observation with images taken after `end`; the depth is the median of several images.

        Args:
            end: end of the last motion.
            read_pose: takes the time of the colour image on the robot's clock, and returns the odometry; called when
                the images have arrived.

        Raises:
            SensorLostError: a camera is silent, or its images do not fit the profile.
        """
        began_s = time.monotonic()
        match, instances = self._await_images(end)
        further = self._further.beside(match.color.stamp_s)
        attitude, depths = self._attitude_of(match)
        got_s = time.monotonic()
        camera = self._profile.camera
        try:
            rgb = decode_color(self._link.image(match.color.payload))
            frames = [decode_depth(self._link.image(frame.payload)) for frame in depths]
        except ImageError as error:
            raise SensorLostError(
                f"{error}", advice="check that the camera driver is that of the profile", code=error.code
            ) from error
        for what, image in (("color", rgb), *(("depth", frame) for frame in frames[-1:])):
            height, width = image.shape[:2][:: -1 if self._link.image_turns % 2 else 1]
            if (width, height) != (camera.width, camera.height) and not (what == "depth" and self._has_own_size(image)):
                raise SensorLostError(
                    f"the {what} image is {width}x{height}, the profile has {camera.width}x{camera.height}",
                    advice="set the mode of the camera driver, or the camera of the profile; depth of another size "
                    "needs a camera_info of that size",
                    code="wrong-image-size",
                )
        try:
            depth_m = median_depth_m(frames, camera.depth_min_m, camera.depth_max_m) if frames else None
        except ValueError as error:
            raise SensorLostError(f"{self._names.depth}: {error}") from error
        beyond = None if depth_m is None else beyond_range(frames[-1], depth_m, camera.depth_max_m)
        invalid_after = share_invalid(depth_m) if depth_m is not None else math.nan
        if invalid_after > _MAX_INVALID and (fault := range_fault(frames[-1], camera)):
            raise SensorLostError(f"{self._names.depth}: {fault}", advice=WRONG_UNIT, code="wrong-depth-range")
        try:
            rgb = self._rectifier(self._names.color, attitude).image(rgb)
            if instances is not None:
                labels = self._rectifier(self._names.color, attitude).labels(instances.ids)
                instances = InstanceImage(labels, instances.categories)
            if depth_m is not None:
                rectifier = self._rectifier(self._names.depth, attitude, frames[-1].shape[::-1])
                depth_m = rectifier.depth(depth_m)
                beyond = None if beyond is None else rectifier.labels(beyond)
        except CalibrationError as error:
            raise SensorLostError(error.statement, advice=error.advice, code=error.code) from error
        sensing = {
            "waited_s": got_s - began_s,  # until the images arrived
            "computed_s": time.monotonic() - got_s,
            "skew_s": match.skew_s,  # colour stamp minus depth stamp
            "depth_frames": len(frames),
            "invalid_before": float((frames[-1] == 0).mean()) if frames and frames[-1].dtype.kind == "u" else math.nan,
            "invalid_after": invalid_after,  # of the median
        }
        sensing |= self._rates.look(self._link.snapshot(), time.monotonic())
        if self._names.attitude is not None:
            sensing |= {"roll_deg": math.degrees(attitude.roll_rad), "pitch_deg": math.degrees(attitude.pitch_rad)}
        pose = read_pose(match.color.stamp_s)
        return Observation(
            rgb=rgb,
            depth_m=depth_m,
            pose=pose,
            stamp_s=match.color.stamp_s,
            camera=camera.on(attitude),
            instances=instances,
            depth_stamp_s=match.depths[-1].stamp_s if match.depths else None,
            beyond_range=beyond,
            sensing={name: number for name, number in sensing.items() if math.isfinite(number)},
            cameras=self._further.seen(further, attitude, pose),
            depth_frame_digest=hashlib.blake2b(frames[-1].tobytes(), digest_size=16).digest() if frames else None,
        )

    def depth_of(self, image: Stamped[Any]) -> tuple[npt.NDArray[np.float32], Camera]:
        """Return one depth image of a snapshot (H, W), metres, NaN where invalid, unfiltered; and its camera.

        Raises:
            ImageError: it cannot be decoded.
            CalibrationError: it cannot be rectified.
            SensorLostError: the attitude of the base at the image is not known.
            ValueError: its size does not fit.
        """
        camera, attitude = self._profile.camera, self._attitude_at(self._link.snapshot(), image.stamp_s)
        if attitude is None:
            raise self._no_attitude()
        frame = decode_depth(self._link.image(image.payload))
        depth_m = median_depth_m([frame], camera.depth_min_m, camera.depth_max_m)
        rectifier = self._rectifier(self._names.depth, attitude, frame.shape[::-1])
        return rectifier.depth(depth_m), camera.on(attitude)

    def _attitude_at(self, now: RobotSnapshot, stamp_s: float) -> Attitude | None:
        """Return the attitude of the base at a time; level for a profile without its source."""
        if self._names.attitude is None:
            return LEVEL
        attitude = attitude_at(now.attitudes, stamp_s)
        return None if attitude is None else attitude.rounded

    def _no_attitude(self) -> SensorLostError:
        source, fault = self._names.attitude, self._link.snapshot().attitude_fault
        if fault or source is None:
            return SensorLostError(fault, code="no-attitude")
        return SensorLostError(
            f"{source.topic} has no attitude at the time of the image",
            advice="check that it is published, and that the clocks of its machine and the camera's agree",
            code="no-attitude",
        )

    def _attitude_of(self, match: MatchedImages[Any]) -> tuple[Attitude, Sequence[Stamped[Any]]]:
        """Return the attitude at the newest image, and the depth images that were taken at the same attitude.

        Raises:
            SensorLostError: it is not known.
        """
        newest_s = (match.depths[-1] if match.depths else match.color).stamp_s
        attitude = self._link.wait_for(lambda now: self._attitude_at(now, newest_s), _ATTITUDE_S)
        if attitude is None:
            raise self._no_attitude()
        now = self._link.snapshot()
        others = [self._attitude_at(now, frame.stamp_s) for frame in match.depths]
        return attitude, [
            frame
            for frame, other in zip(match.depths, others, strict=True)
            if other is not None and other.turned_from(attitude) <= _SAME_ATTITUDE_RAD
        ]

    def preview(self) -> npt.NDArray[np.uint8] | None:
        """Return the newest colour image, or None if it is older than two seconds; thread-safe."""
        colors = self._link.snapshot().colors
        if not colors or time.monotonic() - colors[-1].arrival_s > _STALE_S:
            return None
        try:
            return self._rectifier(self._names.color).image(decode_color(self._link.image(colors[-1].payload)))
        except (ImageError, CalibrationError, ValueError):
            return None

    def _await_images(self, end: MotionEnd) -> tuple[MatchedImages[Any], InstanceImage | None]:
        """Return matching images, and the labels of the colour image if a simulator publishes them."""

        def complete(now: RobotSnapshot, skew_s: float = MAX_SKEW_S) -> tuple[MatchedImages[Any], RobotSnapshot] | None:
            colors: Sequence[Stamped[Any]] = now.colors
            if self.labelled:
                labelled = {image.stamp_s for image in now.labels} if now.categories is not None else set()
                colors = [image for image in now.colors if image.stamp_s in labelled]
            colors, depths = not_ahead(colors, now), not_ahead(now.depths, now)
            match = match_images(colors, depths, end, self.depth_frames, skew_s)
            return (match, now) if match else None

        found = None
        if self.depth_frames == 1:
            found = self._link.wait_for(lambda now: complete(now, _PAIRED_SKEW_S), _PAIRING_S)
        found = found or self._link.wait_for(complete, observation_timeout_s(self._names))
        if found is None:
            raise missing_images(self._names, self._link.snapshot(), time.monotonic())
        match, now = found
        for labels in now.labels if self.labelled else ():
            if labels.stamp_s == match.color.stamp_s:
                ids = decode_labels(self._link.image(labels.payload))
                return match, InstanceImage(ids=ids, categories=now.categories or {})
        return match, None

    def _has_own_size(self, depth: npt.NDArray[Any]) -> bool:
        """Whether a depth image has another size than the profile's, for which its camera is calibrated."""
        calibration = self._link.snapshot().calibrations.get(self._names.depth)
        return is_of_own_size(calibration, self._profile.camera, depth.shape[::-1], self._link.image_turns)

    def _rectifier(self, topic: str, attitude: Attitude = LEVEL, size: tuple[int, ...] = ()) -> Rectifier:
        """Return the rectifier of a topic for the newest calibration and an attitude of the base.

        Args:
            topic: topic of the images.
            attitude: attitude of the base at the images.
            size: width and height of the topic's depth images; empty for those of the profile.

        Raises:
            CalibrationError: the calibration cannot be used, or contradicts the profile.
        """
        calibration, camera = self._link.snapshot().calibrations.get(topic), self._profile.camera
        is_depth = topic == self._names.depth and len(size) == 2
        own = is_depth and is_of_own_size(calibration, camera, (size[0], size[1]), self._link.image_turns)
        return self._rectifier_of(topic, camera, attitude, own=own)

    def _rectifier_of(self, topic: str, camera: Camera, attitude: Attitude, *, own: bool = False) -> Rectifier:
        """Return the rectifier of a topic to a camera; `own` is whether its images have a size of their own."""
        calibration = self._link.snapshot().calibrations.get(topic)
        with self._changing:  # the guard looks while the model gets an observation
            known = self._rectifiers.get((topic, attitude))
            if known is not None and known[0] is calibration and known[1] is own:
                return known[2]
            rectifier = rectifier_of(calibration, camera, topic, self._link.image_turns, attitude, of_own_size=own)
            if len(self._rectifiers) >= _RECTIFIERS:
                self._rectifiers.pop(next(iter(self._rectifiers)))
            self._rectifiers[topic, attitude] = calibration, own, rectifier
            return rectifier


def _size_of(calibration: Calibration) -> tuple[int, ...]:
    return (calibration.width, calibration.height) if isinstance(calibration, Intrinsics) else ()
