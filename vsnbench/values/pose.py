"""Planar poses in REP-103 frames: x forward, y left, heading counter-clockwise; metres and radians.

An attitude is what a pose leaves out: roll and pitch of the body.
"""

import math
from dataclasses import dataclass
from math import isfinite
from typing import Self

import numpy as np
import numpy.typing as npt

_ATTITUDE_STEP_RAD = math.radians(0.25)
_MOST_NORM_ERROR = 0.05
"""Largest error of the length of a quaternion."""


def wrap_angle(angle_rad: float) -> float:
    """Return the equivalent angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose:
    """Position and heading in some parent frame (the site's, or the start of the episode)."""

    x_m: float
    y_m: float
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (isfinite(self.x_m) and isfinite(self.y_m) and isfinite(self.heading_rad)):
            raise ValueError(f"a pose needs finite numbers, not {self}")

    @classmethod
    def from_degrees(cls, x_m: float, y_m: float, heading_deg: float) -> Self:
        """Return the pose whose heading is given in degrees."""
        return cls(x_m, y_m, math.radians(heading_deg))

    @property
    def position(self) -> tuple[float, float]:
        """(x, y) in metres."""
        return (self.x_m, self.y_m)

    @property
    def heading_deg(self) -> float:
        """The heading in degrees, not wrapped."""
        return math.degrees(self.heading_rad)

    @property
    def wrapped(self) -> Self:
        """The same pose with its heading in (-pi, pi]."""
        return type(self)(self.x_m, self.y_m, wrap_angle(self.heading_rad))

    def compose(self, local: "Pose") -> "Pose":
        """Return `local`, given in this pose's frame, in the parent frame."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose(
            self.x_m + cos * local.x_m - sin * local.y_m,
            self.y_m + sin * local.x_m + cos * local.y_m,
            self.heading_rad + local.heading_rad,
        )

    def relative_to(self, origin: "Pose") -> "Pose":
        """Return this pose in the frame of `origin`; the inverse of `origin.compose`."""
        cos, sin = math.cos(origin.heading_rad), math.sin(origin.heading_rad)
        dx, dy = self.x_m - origin.x_m, self.y_m - origin.y_m
        return Pose(cos * dx + sin * dy, -sin * dx + cos * dy, self.heading_rad - origin.heading_rad)

    def distance_to(self, other: "Pose") -> float:
        """Euclidean distance between the positions, in metres."""
        return math.hypot(other.x_m - self.x_m, other.y_m - self.y_m)


def advanced(pose: Pose, way_m: float, turn_rad: float) -> Pose:
    """Return the pose after a short arc with the given length and turn."""
    middle_rad = pose.heading_rad + turn_rad / 2
    return Pose(
        pose.x_m + way_m * math.cos(middle_rad), pose.y_m + way_m * math.sin(middle_rad), pose.heading_rad + turn_rad
    )


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll and pitch of a body in REP-103 axes, radians: heading, then pitch, then roll turn the axes in this order.

    A positive roll lowers the right side, a positive pitch lowers the front.
    """

    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    @classmethod
    def of_quaternion(cls, x: float, y: float, z: float, w: float) -> Self:
        """Return the attitude of an orientation.

        Raises:
            ValueError: it is not a unit quaternion.
        """
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if not abs(norm - 1) <= _MOST_NORM_ERROR:
            raise ValueError(f"({x:g}, {y:g}, {z:g}, {w:g}) is not a unit quaternion")
        x, y, z, w = x / norm, y / norm, z / norm, w / norm
        pitch_rad = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        return cls(math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), pitch_rad)

    @property
    def rotation(self) -> npt.NDArray[np.float64]:
        """(3, 3) axes of the body as columns, in axes with its heading on a level floor."""
        cos_r, sin_r = math.cos(self.roll_rad), math.sin(self.roll_rad)
        cos_p, sin_p = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return np.array(
            [[cos_p, sin_p * sin_r, sin_p * cos_r], [0.0, cos_r, -sin_r], [-sin_p, cos_p * sin_r, cos_p * cos_r]]
        )

    @property
    def lean_rad(self) -> float:
        """Angle between the body's upward axis and the vertical."""
        return math.acos(max(-1.0, min(1.0, math.cos(self.roll_rad) * math.cos(self.pitch_rad))))

    @property
    def rounded(self) -> "Attitude":
        """The attitude in steps of 0.25°, so that what depends on it need not be computed for each image."""
        roll, pitch = (round(angle / _ATTITUDE_STEP_RAD) for angle in (self.roll_rad, self.pitch_rad))
        return Attitude(roll * _ATTITUDE_STEP_RAD, pitch * _ATTITUDE_STEP_RAD)

    def turned_from(self, other: "Attitude") -> float:
        """Return the larger of the differences in roll and pitch, radians."""
        return max(abs(self.roll_rad - other.roll_rad), abs(self.pitch_rad - other.pitch_rad))


LEVEL = Attitude()
