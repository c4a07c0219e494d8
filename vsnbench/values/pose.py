"""Planar poses in REP-103 frames: x forward, y left, heading counter-clockwise; metres and radians."""

import math
from dataclasses import dataclass
from math import isfinite
from typing import Self


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
