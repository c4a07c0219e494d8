"""Images of a robot on a ROS network, captured after a motion: colour, the median of several depths, labels."""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError
from vsnbench.protocol.observation import InstanceImage
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.ros_link import RobotLink, RobotTopics
from vsnbench.sensing.camera_images import (
    ImageError,
    MatchedImages,
    MotionEnd,
    Stamped,
    decode_color,
    decode_depth,
    decode_labels,
    match_images,
    median_depth_m,
    share_invalid,
)
from vsnbench.sensing.robot_reports import RobotSnapshot

CAMERA_TIMEOUT_S = 3.0
Pixels = TypeVar("Pixels", bound=npt.NDArray[Any])
_MAX_SKEW_S = 0.1
_STALE_S = 2.0
"""An older image is not what the robot sees now."""


@dataclass(frozen=True, slots=True)
class CaptureReport:
    """How the images of an observation came about."""

    waited_s: float
    """For images taken after the motion: the camera's time, not ours."""
    computed_s: float
    """Decoding and filtering."""
    skew_s: float
    """Colour stamp minus depth stamp."""
    depth_frames: int
    invalid_before: float
    """Share of pixels without a measurement in the newest depth image."""
    invalid_after: float
    """The same after the median."""

    @property
    def numbers(self) -> dict[str, float]:
        """The report by name, for the record; what is not known is left out."""
        return {name: number for name, number in asdict(self).items() if math.isfinite(number)}


@dataclass(frozen=True, slots=True, eq=False)
class Images:
    """The images of one observation."""

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    depth_m: npt.NDArray[np.float32] | None
    """(H, W) metres; None for a robot without depth."""
    instances: InstanceImage | None
    """None without labels, which only a simulator has."""
    stamp_s: float
    depth_stamp_s: float | None
    report: CaptureReport


class RosCamera:
    """Waits for images of one moment, taken after a motion, and decodes them."""

    def __init__(self, link: RobotLink, profile: RobotProfile) -> None:
        self._link = link
        self._profile = profile
        self._names: RobotTopics = link.names
        self.depth_frames = self._names.depth_frames if self._names.depth else 0
        """How many depth images the median is taken of."""
        self.labelled = link.has_labels
        """Whether a simulator labels the images; asked once, for a master may die in an episode."""

    def capture(self, end: MotionEnd) -> Images:
        """Return images taken after `end`.

        Raises:
            SensorLostError: a camera is silent, or sends what is not in the profile.
        """
        began_s = time.monotonic()
        match, instances = self._await_images(end)
        got_s = time.monotonic()
        camera = self._profile.camera
        try:
            rgb = self._upright(decode_color(self._link.image(match.color.payload)))
            frames = [self._upright(decode_depth(self._link.image(frame.payload))) for frame in match.depths]
        except ImageError as error:
            raise SensorLostError(f"{error}", advice="is the camera driver the one of the profile?") from error
        for what, image in (("color", rgb), *(("depth", frame) for frame in frames[-1:])):
            height, width = image.shape[:2]
            if (width, height) != (camera.width, camera.height):
                raise SensorLostError(
                    f"the {what} image is {width}x{height}, the profile says {camera.width}x{camera.height}",
                    advice="set the camera driver's mode, or the profile's camera",
                )
        try:
            depth_m = median_depth_m(frames, camera.depth_min_m, camera.depth_max_m) if frames else None
        except ValueError as error:
            raise SensorLostError(f"{self._names.depth}: {error}") from error
        report = CaptureReport(
            waited_s=got_s - began_s,
            computed_s=time.monotonic() - got_s,
            skew_s=match.skew_s,
            depth_frames=len(frames),
            invalid_before=float((frames[-1] == 0).mean()) if frames and frames[-1].dtype.kind == "u" else math.nan,
            invalid_after=share_invalid(depth_m) if depth_m is not None else math.nan,
        )
        depth_stamp_s = match.depths[-1].stamp_s if match.depths else None
        return Images(rgb, depth_m, instances, match.color.stamp_s, depth_stamp_s, report)

    def glimpse(self) -> npt.NDArray[np.uint8] | None:
        """Return the colour image that came last, from any thread; None where the last is older than two seconds."""
        colors = self._link.snapshot().colors
        if not colors or time.monotonic() - colors[-1].arrival_s > _STALE_S:
            return None
        try:
            return self._upright(decode_color(self._link.image(colors[-1].payload)))
        except ImageError:
            return None

    def _await_images(self, end: MotionEnd) -> tuple[MatchedImages[Any], InstanceImage | None]:
        """Return images that belong together, and the simulator's labels of the colour image where there are some."""

        def complete(now: RobotSnapshot) -> tuple[MatchedImages[Any], RobotSnapshot] | None:
            colors: Sequence[Stamped[Any]] = now.colors
            if self.labelled:
                labelled = {image.stamp_s for image in now.labels} if now.categories else set()
                colors = [image for image in now.colors if image.stamp_s in labelled]
            match = match_images(colors, now.depths, end, self.depth_frames, _MAX_SKEW_S)
            return (match, now) if match else None

        timeout_s = CAMERA_TIMEOUT_S + self.depth_frames / self._names.camera_rate_hz
        found = self._link.wait_for(complete, timeout_s)
        if found is None:
            raise self._missing_images(timeout_s)
        match, now = found
        for labels in now.labels if self.labelled else ():
            if labels.stamp_s == match.color.stamp_s:
                ids = self._upright(decode_labels(self._link.image(labels.payload)))
                return match, InstanceImage(ids=ids, categories=now.categories)
        return match, None

    def _upright(self, pixels: Pixels) -> Pixels:
        """Return an image as if the camera did not sit askew."""
        turns = self._link.image_turns
        return cast("Pixels", np.ascontiguousarray(np.rot90(pixels, -turns))) if turns else pixels

    def _missing_images(self, waited_s: float) -> SensorLostError:
        names, now, now_s = self._names, self._link.snapshot(), time.monotonic()
        silent = []
        for topic, images in ((names.color, now.colors), (names.depth, now.depths)):
            if rivals := now.rivals(topic, now_s):
                return rivals
            if topic and (not images or now_s - images[-1].arrival_s > 1.0):
                silent.append(topic)
        if silent:
            topics = " and ".join(silent)
            return SensorLostError(f"no image on {topics} for {waited_s:.0f} s", advice="is the camera driver running?")
        return SensorLostError(
            f"images come on {names.color} and {names.depth}, but none within {waited_s:.0f} s that was stamped after "
            f"the motion, colour within {_MAX_SKEW_S:g} s of depth",
            advice="are the clocks in step (vsnbench doctor)?",
        )
