"""What the cameras of a robot on a ROS 1 network show after a motion: colour, the median of several depths, labels."""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError
from vsnbench.protocol.observation import InstanceImage
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.interface import ros1_interface
from vsnbench.sensing.depth_filter import median_depth_m, share_invalid
from vsnbench.sensing.image_decoding import ImageError, decode_color, decode_depth, decode_labels
from vsnbench.sensing.pairing import Look, MotionEnd, Stamped, choose_look

if TYPE_CHECKING:
    from vsnbench.ros1.robot_link import RobotLink

CAMERA_TIMEOUT_S = 3.0
_MAX_SKEW_S = 0.1


@dataclass(frozen=True, slots=True)
class LookReport:
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
    report: LookReport


class RosCamera:
    """Waits for images of one moment, taken after a motion, and decodes them."""

    def __init__(self, link: "RobotLink", profile: RobotProfile) -> None:
        self._link = link
        self._profile = profile
        self._names = ros1_interface(profile)
        self.depth_frames = self._names.depth_frames if self._names.depth else 0
        """How many depth images the median is taken of."""
        self.labelled = link.has_labels
        """Whether a simulator labels the images; asked once, of the master, which may die in an episode."""

    def look(self, end: MotionEnd) -> Images:
        """Return images taken after `end`.

        Raises:
            SensorLostError: a camera is silent, or sends what is not in the profile.
        """
        began_s = time.monotonic()
        look = self._await_look(end)
        instances = self._labels_of(look.color)  # now: while depth is filtered, newer labels push these out
        got_s = time.monotonic()
        camera = self._profile.camera
        try:
            rgb = decode_color(look.color.payload)
            frames = [decode_depth(frame.payload) for frame in look.depths]
        except ImageError as error:
            raise SensorLostError(f"{error}: is the camera driver the one of the profile?") from error
        for what, image in (("color", rgb), *(("depth", frame) for frame in frames[-1:])):
            height, width = image.shape[:2]
            if (width, height) != (camera.width, camera.height):
                raise SensorLostError(
                    f"the {what} image is {width}x{height}, the profile says {camera.width}x{camera.height}: "
                    "set the camera driver's mode, or the profile's camera"
                )
        try:
            depth_m = median_depth_m(frames, camera.depth_min_m, camera.depth_max_m) if frames else None
        except ValueError as error:
            raise SensorLostError(f"{self._names.depth}: {error}") from error
        report = LookReport(
            waited_s=got_s - began_s,
            computed_s=time.monotonic() - got_s,
            skew_s=look.skew_s,
            depth_frames=len(frames),
            invalid_before=float((frames[-1] == 0).mean()) if frames and frames[-1].dtype.kind == "u" else math.nan,
            invalid_after=share_invalid(depth_m) if depth_m is not None else math.nan,
        )
        depth_stamp_s = look.depths[-1].stamp_s if look.depths else None
        return Images(rgb, depth_m, instances, look.color.stamp_s, depth_stamp_s, report)

    def _await_look(self, end: MotionEnd) -> Look[Any]:
        found: list[Look[Any]] = []

        def complete() -> bool:
            link = self._link
            colors: Sequence[Stamped[Any]] = link.colors
            if self.labelled:
                labelled = {frame.stamp_s for frame in link.labels} if link.categories else set()
                colors = [frame for frame in link.colors if frame.stamp_s in labelled]
            look = choose_look(colors, link.depths, end, self.depth_frames, _MAX_SKEW_S)
            found.extend([look] if look else [])
            return bool(found)

        timeout_s = CAMERA_TIMEOUT_S + self.depth_frames / self._names.camera_rate_hz
        if not self._link.wait_for(complete, timeout_s):
            raise SensorLostError(self._missing_images(timeout_s))
        return found[0]

    def _missing_images(self, waited_s: float) -> str:
        names, now_s = self._names, time.monotonic()
        silent = []
        for topic, frames in ((names.color, self._link.colors), (names.depth, self._link.depths)):
            if topic and (not frames or now_s - frames[-1].arrival_s > 1.0):
                silent.append(topic)
        if silent:
            return f"no image on {' and '.join(silent)} for {waited_s:.0f} s: is the camera driver running?"
        return (
            f"images come on {names.color} and {names.depth}, but none within {waited_s:.0f} s that was stamped after "
            f"the motion, colour within {_MAX_SKEW_S:g} s of depth: are the clocks in step (vsnbench doctor)?"
        )

    def _labels_of(self, color: Stamped[Any]) -> InstanceImage | None:
        """Return the simulator's labels of a colour image; its look was chosen so that there are some."""
        with self._link.news:
            for frame in self._link.labels:
                if frame.stamp_s == color.stamp_s:
                    return InstanceImage(ids=decode_labels(frame.payload), categories=self._link.categories)
        return None
