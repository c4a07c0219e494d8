"""The camera that a model was trained with, and how a robot's camera differs from it."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from vsnbench.values.camera import Camera

HEIGHT_LIMIT_M: Final = 0.02
ANGLE_LIMIT_DEG: Final = 1.0
"""Smaller differences are within the accuracy of a calibration."""
SIZE_SHARE: Final = 0.01
"""Relative difference of a field of view that counts as none when an image is cropped."""

Range = tuple[float, float]
"""Lowest and highest value."""


def _ordered(value: Range) -> Range:
    if value[0] > value[1]:
        raise ValueError("the first number of a range must not exceed the second")
    return value


_Height = Annotated[float, Field(gt=0, lt=3)]
_Tilt = Annotated[float, Field(ge=-90, lt=60)]
_View = Annotated[float, Field(gt=10, lt=170)]
_Pixels = Annotated[int, Field(gt=0, le=4096)]


class TrainedCamera(BaseModel):
    """Camera that a model was trained with; None where it is not stated.

    A pair of numbers is a range, for a model that was trained with cameras between both.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    mount_height_m: _Height | Annotated[tuple[_Height, _Height], AfterValidator(_ordered)] | None = Field(
        default=None, description="optical centre above the floor, metres"
    )
    tilt_deg: _Tilt | Annotated[tuple[_Tilt, _Tilt], AfterValidator(_ordered)] | None = Field(
        default=None, description="degrees; positive looks up"
    )
    horizontal_fov_deg: _View | Annotated[tuple[_View, _View], AfterValidator(_ordered)] | None = Field(
        default=None, description="horizontal field of view, degrees"
    )
    width: _Pixels | None = Field(default=None, description="image width, pixels")
    height: _Pixels | None = Field(default=None, description="image height, pixels")

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if (self.width is None) != (self.height is None):
            raise ValueError("width and height must be stated together")
        return self

    @property
    def horizontal_fov_range_deg(self) -> Range | None:
        """Horizontal fields of view; None if not stated."""
        return _range(self.horizontal_fov_deg)

    @property
    def vertical_fov_range_deg(self) -> Range | None:
        """Vertical fields of view, degrees; None without a horizontal one and a resolution."""
        across = self.horizontal_fov_range_deg
        if across is None or self.width is None or self.height is None:
            return None
        low, high = (vertical_fov_deg(view, self.width, self.height) for view in across)
        return (low, high)

    @property
    def text(self) -> str:
        """What is stated, in one line."""
        parts = (
            _stated(self.mount_height_m, " m", "height"),
            _stated(self.tilt_deg, "°", "tilt"),
            _stated(self.horizontal_fov_deg, "°", "field of view"),
            f"{self.width} x {self.height} pixels" if self.width is not None else "",
        )
        return ", ".join(filter(None, parts))

    def differences(self, camera: Camera) -> tuple["CameraDifference", ...]:
        """Return how a robot's camera differs, as far as this camera is stated."""
        vertical_deg = vertical_fov_deg(camera.horizontal_fov_deg, camera.width, camera.height)
        quantities = (
            ("mount_height_m", self.mount_height_m, camera.mount_height_m, HEIGHT_LIMIT_M),
            ("tilt_deg", self.tilt_deg, camera.tilt_deg, ANGLE_LIMIT_DEG),
            ("horizontal_fov_deg", self.horizontal_fov_deg, camera.horizontal_fov_deg, ANGLE_LIMIT_DEG),
            ("vertical_fov_deg", self.vertical_fov_range_deg, vertical_deg, ANGLE_LIMIT_DEG),
        )
        found = []
        for name, stated, actual, limit in quantities:
            trained = _range(stated)
            if trained is None:
                continue
            nearest = min(max(actual, trained[0]), trained[1])
            if abs(actual - nearest) > limit:
                found.append(CameraDifference(name, nearest, actual))
        own_px = (camera.width, camera.height)
        if self.width is not None and self.height is not None and (self.width, self.height) != own_px:
            found.append(CameraDifference("resolution_px", (self.width, self.height), own_px))
        return tuple(found)


@dataclass(frozen=True, slots=True)
class CameraDifference:
    """A quantity in which a robot's camera differs from the camera that a model was trained with."""

    quantity: str
    """`mount_height_m`, `tilt_deg`, `horizontal_fov_deg`, `vertical_fov_deg` or `resolution_px` (width, height)."""
    trained: float | tuple[int, int]
    """Of a range, the nearest value."""
    actual: float | tuple[int, int]

    @property
    def text(self) -> str:
        """The difference in words, like `0.28 m lower`."""
        if isinstance(self.actual, tuple) or isinstance(self.trained, tuple):
            own, trained = (
                " x ".join(map(str, size)) for size in (self.actual, self.trained) if isinstance(size, tuple)
            )
            return f"{own} instead of {trained} pixels"
        gap = abs(self.actual - self.trained)
        more = self.actual > self.trained
        match self.quantity:
            case "mount_height_m":
                return f"{gap:.2f} m {'higher' if more else 'lower'}"
            case "tilt_deg":
                return f"{round(gap, 1):g}° further {'up' if more else 'down'}"
            case "horizontal_fov_deg":
                return f"{round(gap, 1):g}° {'wider' if more else 'narrower'}"
        return f"{round(gap, 1):g}° {'wider' if more else 'narrower'} vertically"


def vertical_fov_deg(horizontal_fov_deg: float, width: float, height: float) -> float:
    """Return the vertical field of view of a pinhole camera with square pixels, degrees."""
    return math.degrees(2 * math.atan(math.tan(math.radians(horizontal_fov_deg) / 2) * height / width))


def cropped(trained: TrainedCamera, camera: Camera) -> Camera:
    """Return the central part of a camera's view that has the trained field of view, at the camera's resolution.

    An axis whose trained field of view is not stated stays as it is, as does an axis within a trained range.

    Raises:
        ValueError: the camera sees less than the trained field of view in an axis; the message names both.
    """
    vertical_deg = vertical_fov_deg(camera.horizontal_fov_deg, camera.width, camera.height)
    axes = (
        ("horizontally", camera.width, camera.horizontal_fov_deg, trained.horizontal_fov_range_deg),
        ("vertically", camera.height, vertical_deg, trained.vertical_fov_range_deg),
    )
    sides = []
    for axis, pixels, own_deg, wanted in axes:
        if wanted is None or wanted[0] <= own_deg <= wanted[1]:
            sides.append(pixels)
            continue
        wanted_deg = wanted[1] if own_deg > wanted[1] else wanted[0]
        wanted_px = 2 * camera.focal_px * math.tan(math.radians(wanted_deg) / 2)
        if wanted_px > pixels * (1 + SIZE_SHARE):
            raise ValueError(f"{own_deg:.3g}° {axis}, less than the {wanted_deg:.3g}°")
        # The principal point stays central: the same number of pixels is cut on both sides.
        sides.append(pixels - 2 * max(0, round((pixels - wanted_px) / 2)))
    return part_of(camera, *sides)


def part_of(camera: Camera, width: int, height: int) -> Camera:
    """Return the central `width` x `height` pixels of a camera."""
    if (width, height) == (camera.width, camera.height):
        return camera
    fov_deg = math.degrees(2 * math.atan(width / 2 / camera.focal_px))
    return camera.model_copy(update={"width": width, "height": height, "horizontal_fov_deg": fov_deg})


def _range(value: float | Range | None) -> Range | None:
    return (value, value) if isinstance(value, int | float) else value


def _stated(value: float | Range | None, unit: str, name: str) -> str:
    values = _range(value)
    if values is None:
        return ""
    low, high = values
    return f"{name} {low:g}{unit}" if low == high else f"{name} {low:g} to {high:g}{unit}"
