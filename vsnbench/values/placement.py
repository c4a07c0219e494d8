"""Measured placement of a robot at the start of an episode: pose, covariance, and advice for the operator."""

import math
from dataclasses import astuple, dataclass
from enum import StrEnum
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.values.pose import Pose, wrap_angle

FLOOR_REGION = -2 * math.log(0.045)
HEADING_REGION = 2.807**2
"""The 95 % region is an ellipse on the floor with 95.5 % and an interval of headings with 99.5 %: together at least 95
% for any correlation of position and heading. These are the squares of their half axes, in variances: quantiles of chi
squared with two degrees of freedom and with one.
"""


class PlacementTolerance(BaseModel):
    """Tolerance of a robot's placement at the start of an episode; the 95 % region must be inside."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    distance_m: float = Field(default=0.10, gt=0, le=1, description="from the mark")
    heading_deg: float = Field(default=3.0, gt=0, le=45, description="from the mark's heading")


class PlacementMethod(StrEnum):
    """Data of a placement's measurement."""

    LOOK = "look"
    """One depth image."""
    TURN = "turn"
    """Depth images of a turn on the spot, at the headings of the odometry."""
    DRIVE = "drive"
    """Depth images of the last steps before a stop, at the poses of the odometry."""


@dataclass(frozen=True, slots=True)
class PoseCovariance:
    """Covariance of x, y and heading in some frame: m², m·rad, rad²."""

    xx: float
    xy: float
    xh: float
    yy: float
    yh: float
    hh: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.values)) or min(self.xx, self.yy, self.hh) < 0:
            raise ValueError(f"a covariance needs finite numbers and no negative variance, not {self}")

    @property
    def values(self) -> tuple[float, ...]:
        """The six numbers: xx, xy, xh, yy, yh, hh."""
        return astuple(self)

    @classmethod
    def of(cls, matrix: npt.NDArray[np.float64]) -> Self:
        """Return the covariance of a symmetric (3, 3) matrix."""
        return cls(*(float(matrix[row, column]) for row, column in zip(*np.triu_indices(3), strict=True)))

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """(3, 3) matrix."""
        return np.array([[self.xx, self.xy, self.xh], [self.xy, self.yy, self.yh], [self.xh, self.yh, self.hh]])

    def turned(self, angle_rad: float) -> "PoseCovariance":
        """Return the covariance in a frame that is rotated by `-angle_rad`."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return PoseCovariance.of(turn @ self.matrix @ turn.T)

    @property
    def region_m(self) -> float:
        """Half the longest axis of the 95 % region on the floor, metres."""
        return math.sqrt(FLOOR_REGION * float(np.linalg.eigvalsh(self.matrix[:2, :2])[-1]))

    @property
    def region_rad(self) -> float:
        """Half the width of the 95 % region in heading."""
        return math.sqrt(HEADING_REGION * self.hh)

    def holds(self, away: Pose) -> bool:
        """Whether the 95 % region around a pose contains a pose with these differences of x, y and heading."""
        place = np.array(away.position)
        on_floor = float(place @ np.linalg.solve(self.matrix[:2, :2], place)) <= FLOOR_REGION
        return on_floor and abs(math.remainder(away.heading_rad, math.tau)) <= self.region_rad


class Direction(StrEnum):
    """Direction of a correction, relative to the robot."""

    FORWARD = "forward"
    BACKWARD = "backward"
    LEFT = "left"
    RIGHT = "right"
    TURN_LEFT = "turn left"
    TURN_RIGHT = "turn right"


@dataclass(frozen=True, slots=True)
class Arrow:
    """One correction of a robot's pose."""

    direction: Direction
    amount: float
    """Metres; degrees for a turn."""

    @property
    def turns(self) -> bool:
        """Whether it is a turn."""
        return self.direction in (Direction.TURN_LEFT, Direction.TURN_RIGHT)

    @property
    def text(self) -> str:
        """The correction as text."""
        return f"{self.direction} {self.amount:.0f}°" if self.turns else f"{100 * self.amount:.0f} cm {self.direction}"


@dataclass(frozen=True, slots=True)
class MeasuredPlacement:
    """Measured pose of a robot at a mark, and what follows from it."""

    start: int
    """Number of the starting position."""
    mark: Pose
    """Pose of the mark in the site's frame."""
    pose: Pose
    """Measured pose in the site's frame."""
    covariance: PoseCovariance
    """Covariance in the site's frame."""
    tolerance: PlacementTolerance
    method: PlacementMethod
    looks: int
    """Number of depth images of the measurement."""
    fits: bool = True
    """False if the view matches no pose near the mark."""
    undetermined: tuple[str, ...] = ()
    """Names of directions that the view does not determine, relative to the robot."""
    moved: tuple[str, ...] = ()
    """Ids of the site's objects that are not where the survey has them."""
    depth_scale: float = 1.0
    """Correction factor of the depth camera's distances."""
    forward_m: float = 0.0
    """Distance of the camera ahead of its place in the profile; measured only by a turn."""
    forward_std_m: float = math.inf
    """Standard deviation of `forward_m`; infinite if not measured."""
    took_s: float = 0.0

    @property
    def offset(self) -> Pose:
        """Measured pose in the mark's frame: x ahead, y left, heading counter-clockwise."""
        away = self.pose.relative_to(self.mark)
        return Pose(away.x_m, away.y_m, math.remainder(away.heading_rad, math.tau))

    @property
    def offset_covariance(self) -> PoseCovariance:
        """Covariance in the mark's frame."""
        return self.covariance.turned(-self.mark.heading_rad)

    @property
    def region_m(self) -> float:
        """Half the longest axis of the 95 % region on the floor, metres."""
        return self.covariance.region_m

    @property
    def region_deg(self) -> float:
        """Half the width of the 95 % region in heading, degrees."""
        return math.degrees(self.covariance.region_rad)

    def region_holds(self, pose: Pose) -> bool:
        """Whether a pose in the site's frame is in the 95 % region."""
        here = self.pose
        return self.covariance.holds(
            Pose(pose.x_m - here.x_m, pose.y_m - here.y_m, pose.heading_rad - here.heading_rad)
        )

    @property
    def determined(self) -> bool:
        """Whether the measured pose is reliable."""
        return self.fits and not self.undetermined

    @property
    def within_tolerance(self) -> bool:
        """Whether the whole 95 % region is within the tolerance."""
        if not self.determined:
            return False
        inside_m = _farthest_m(self.offset, self.offset_covariance) <= self.tolerance.distance_m
        reach_deg = abs(self.offset.heading_deg) + self.region_deg
        return inside_m and reach_deg <= self.tolerance.heading_deg

    @property
    def arrows(self) -> tuple[Arrow, ...]:
        """Corrections, most important first; none that the measurement does not justify."""
        if not self.determined:
            return ()
        back = self.mark.relative_to(self.pose)
        ahead, left, turn = back.x_m, back.y_m, math.degrees(math.remainder(back.heading_rad, math.tau))
        ways = [
            Arrow(Direction.FORWARD if ahead > 0 else Direction.BACKWARD, abs(ahead)),
            Arrow(Direction.LEFT if left > 0 else Direction.RIGHT, abs(left)),
            Arrow(Direction.TURN_LEFT if turn > 0 else Direction.TURN_RIGHT, abs(turn)),
        ]
        needed = [arrow for arrow in ways if arrow.amount >= (_LEAST_TURN_DEG if arrow.turns else _LEAST_WAY_M)]
        limits = {True: self.tolerance.heading_deg, False: self.tolerance.distance_m}
        return tuple(sorted(needed, key=lambda arrow: arrow.amount / limits[arrow.turns], reverse=True))

    @property
    def headline(self) -> str:
        """Result in one line."""
        if not self.fits:
            return f"the view does not match any pose near mark {self.start}"
        off_cm, off_deg = 100 * math.hypot(*self.offset.position), abs(self.offset.heading_deg)
        where = (
            f"{off_cm:.0f} cm (± {100 * self.region_m:.0f}) and {off_deg:.1f}° (± {self.region_deg:.1f}) off the mark"
        )
        if self.undetermined:
            return f"not determined: {' and '.join(self.undetermined)}"
        return f"in place: {where}" if self.within_tolerance else where

    @property
    def wants_turn(self) -> bool:
        """Whether the next step is a turn on the spot, because one image is not sufficient."""
        if self.method is PlacementMethod.TURN or self.within_tolerance:
            return False
        return not self.determined or not self._is_off

    @property
    def advice(self) -> str:
        """Next step for the operator; empty if the robot is in place."""
        turn = "turn on the spot" if self.wants_turn else "place it by eye"
        if not self.fits:
            return f"check that this is mark {self.start}; if it is, the plan and the room differ: {turn}"
        if self.undetermined:
            if self.method is PlacementMethod.TURN:
                return f"even a full turn shows too little: {turn}"
            return f"this view does not determine {' and '.join(self.undetermined)}: {turn}"
        if self.within_tolerance:
            return ""
        if self.wants_turn:
            return f"the robot may be in place, but one image is too uncertain: {turn}"
        uncertain = "the robot may be in place, but the measurement is too uncertain: move it nearer to the mark"
        return ", ".join(arrow.text for arrow in self.arrows) or uncertain

    @property
    def differs(self) -> str:
        """Differences between plan and room, and between profile and camera; empty if there are none."""
        differences = [f"the plan and the room differ here: {', '.join(self.moved)}"] if self.moved else []
        if self.determined and abs(self.forward_m) > max(_FORWARD_LIMIT_M, 3 * self.forward_std_m):
            side = "farther ahead" if self.forward_m > 0 else "farther back"
            differences.append(
                f"the camera is {100 * abs(self.forward_m):.0f} cm (± {200 * self.forward_std_m:.0f}) {side} than in "
                f"the profile: add {self.forward_m:.2f} to its camera.mount_forward_m"
            )
        return "; ".join(differences)

    @property
    def _is_off(self) -> bool:
        off = self.offset
        worth_moving = math.hypot(*off.position) > self.tolerance.distance_m / 2
        return worth_moving or abs(off.heading_deg) > self.tolerance.heading_deg / 2

    def as_json(self) -> dict[str, Any]:
        """Return the placement as plain values."""
        off = self.offset
        return {
            "start": self.start,
            "pose": {
                "x_m": self.pose.x_m,
                "y_m": self.pose.y_m,
                "heading_deg": math.degrees(wrap_angle(self.pose.heading_rad)),
            },
            "covariance": list(self.covariance.values),
            "offset": {"ahead_m": off.x_m, "left_m": off.y_m, "heading_deg": off.heading_deg},
            "offset_covariance": list(self.offset_covariance.values),
            "region_m": self.region_m,
            "region_deg": self.region_deg,
            "tolerance": self.tolerance.model_dump(),
            "within_tolerance": self.within_tolerance,
            "determined": self.determined,
            "fits": self.fits,
            "undetermined": list(self.undetermined),
            "moved": list(self.moved),
            "method": self.method.value,
            "looks": self.looks,
            "depth_scale": self.depth_scale,
            "forward_m": self.forward_m if math.isfinite(self.forward_std_m) else None,
            "forward_std_m": self.forward_std_m if math.isfinite(self.forward_std_m) else None,
            "took_s": self.took_s,
            "wants_turn": self.wants_turn,
            "headline": self.headline,
            "advice": self.advice,
            "differs": self.differs,
            "arrows": [
                {"direction": arrow.direction.value, "amount": arrow.amount, "words": arrow.text}
                for arrow in self.arrows
            ],
        }


_LEAST_WAY_M, _LEAST_TURN_DEG = 0.01, 0.5
"""Minimum correction by hand."""
_FORWARD_LIMIT_M = 0.025
"""Minimum deviation of a camera's position that is reported."""


def _farthest_m(offset: Pose, covariance: PoseCovariance) -> float:
    """Return the maximum distance of the 95 % region from the mark on the floor, metres."""
    values, axes = np.linalg.eigh(covariance.matrix[:2, :2])
    angles = np.linspace(0.0, math.tau, 72, endpoint=False)
    rim = axes @ (np.sqrt(FLOOR_REGION * np.maximum(values, 0.0))[:, None] * np.array([np.cos(angles), np.sin(angles)]))
    return float(np.hypot(rim[0] + offset.x_m, rim[1] + offset.y_m).max())
