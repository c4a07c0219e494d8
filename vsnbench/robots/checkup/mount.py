"""Check of the camera's mount by the floor in its depth image."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.sensing.images.floor_plane import FloorPlane, Measured, NoFloorError, fit_floor
from vsnbench.values.camera import Camera
from vsnbench.values.pose import LEVEL, Attitude

ANGLE_LIMIT_DEG = 1.0
"""Largest error of tilt and roll."""
HEIGHT_LIMIT_M = 0.02
HEIGHT_LIMIT_SHARE = 0.03
"""The larger of both is the largest error of the height: depth scales are accurate to 1 to 2 %."""
FREE_FLOOR_ADVICE = "turn the robot to 2 m of free floor, without stairs or glass ahead, and repeat"


@dataclass(frozen=True, slots=True)
class MountDifference:
    """A measured quantity of the mount and its value in the profile."""

    field: str
    """Field of the profile's camera."""
    unit: str
    measured: Measured
    profile: float
    limit: float

    @property
    def exceeds(self) -> bool:
        """Whether the difference is larger than the limit and two standard deviations."""
        return abs(self.measured.value - self.profile) > max(self.limit, 2 * self.measured.std)

    @property
    def text(self) -> str:
        """The measurement with its 95 % uncertainty, and the value in the profile."""
        digits = 3 if self.unit == "m" else 1
        value, spread = round(self.measured.value, digits) + 0.0, 2 * self.measured.std
        separator = " " if self.unit == "m" else ""
        return (
            f"{value:.{digits}f} ± {spread:.{digits}f}{separator}{self.unit}; "
            f"the profile has {self.profile:g}{separator}{self.unit}"
        )


def mount_differences(floor: FloorPlane, camera: Camera) -> tuple[MountDifference, ...]:
    """Return the differences of height, tilt and roll.

    Args:
        floor: plane fitted in an image that was rectified to `camera`, without its roll.
        camera: camera of the profile.
    """
    height_m = camera.mount_height_m
    limit_m = max(HEIGHT_LIMIT_M, HEIGHT_LIMIT_SHARE * height_m)
    roll_deg = Measured(floor.roll_deg.value + camera.roll_deg, floor.roll_deg.std)
    return (
        MountDifference("mount_height_m", "m", floor.height_m, height_m, limit_m),
        MountDifference("tilt_deg", "°", floor.tilt_deg, camera.tilt_deg, ANGLE_LIMIT_DEG),
        MountDifference("roll_deg", "°", roll_deg, camera.roll_deg, ANGLE_LIMIT_DEG),
    )


_NAMES = {"mount_height_m": "camera height", "tilt_deg": "camera tilt", "roll_deg": "camera roll"}


def mount_on(
    depth_m: npt.NDArray[np.float32], camera: Camera, attitude: Attitude = LEVEL
) -> tuple[MountDifference, ...]:
    """Return the differences of height, tilt and roll, measured on a base with an attitude, whose share is taken off.

    Args:
        depth_m: (H, W) median of several depth images, rectified to `camera` at the attitude.
        camera: camera of the profile.
        attitude: attitude of the base.

    Raises:
        NoFloorError: the image shows too little floor.
    """
    level = camera.on(attitude)
    floor = fit_floor(depth_m, level)
    height_m, tilt_deg = floor.height_m, floor.tilt_deg
    upright = replace(
        floor,
        height_m=Measured(height_m.value + camera.mount_height_m - level.mount_height_m, height_m.std),
        tilt_deg=Measured(tilt_deg.value + camera.tilt_deg - level.tilt_deg, tilt_deg.std),
    )
    return mount_differences(upright, camera)


def mount_results(
    depth_m: npt.NDArray[np.float32], camera: Camera, attitude: Attitude = LEVEL
) -> Iterator[CheckResult]:
    """Report whether the mount of the camera is that of the profile; for the arguments see `mount_on`."""
    try:
        differences = mount_on(depth_m, camera, attitude)
    except NoFloorError as error:
        yield CheckResult("camera mount", Health.WARNING, f"not checked: {error}", FREE_FLOOR_ADVICE)
        return
    for difference in differences:
        what = _NAMES[difference.field]
        if not difference.exceeds:
            yield CheckResult(what, Health.OK, difference.text)
            continue
        advice = "straighten the camera, or correct the profile: vsnbench robots calibrate PROFILE"
        if difference.field == "mount_height_m":
            scale = difference.measured.value / difference.profile
            advice = (
                "measure the height with a tape. If the profile is wrong: vsnbench robots calibrate PROFILE. If it is "
                f"right, the depth of the camera is {abs(scale - 1):.0%} too {'short' if scale < 1 else 'long'}"
            )
        yield CheckResult(what, Health.FAILED, difference.text, advice)
    unseen = f"{camera.mount_forward_m:g} m"
    if not camera.is_ahead:
        unseen += f", {camera.mount_left_m:g} m to the left, turned by {camera.yaw_deg:g}°"
    seen = f"{unseen} in the profile; images of the floor do not show it"
    yield CheckResult("camera forward", Health.OK, seen)
