"""Where a robot stands at the start of an episode, as it was measured: pose, covariance, and what a person is told."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.protocol.pose import Pose

FLOOR_REGION = -2 * math.log(0.045)
HEADING_REGION = 2.807**2
"""The 95 % region is an ellipse on the floor that holds 95.5 % and a stretch of headings that holds 99.5 %: together at
least 95 %, however position and heading hang together. These are the squares of their half axes, in variances: chi
squared's quantiles with two degrees of freedom and with one.
"""


class PlacementTolerance(BaseModel):
    """How far off its mark a robot may stand at the start of an episode; the stated 95 % region must lie inside."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    distance_m: float = Field(default=0.10, gt=0, le=1, description="from the mark")
    heading_deg: float = Field(default=3.0, gt=0, le=45, description="from the mark's heading")


class PlacementMethod(StrEnum):
    """What a placement was measured from."""

    LOOK = "look"
    """One depth image."""
    TURN = "turn"
    """Depth images of a turn on the spot, at the headings that the odometry says."""


@dataclass(frozen=True, slots=True)
class PoseCovariance:
    """The covariance of x, y and heading in some frame: m², m·rad, rad²."""

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
        return (self.xx, self.xy, self.xh, self.yy, self.yh, self.hh)

    @classmethod
    def of(cls, matrix: npt.NDArray[np.float64]) -> Self:
        """Return that of a symmetric (3, 3) matrix."""
        return cls(*(float(matrix[row, column]) for row, column in zip(*np.triu_indices(3), strict=True)))

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """(3, 3)."""
        return np.array([[self.xx, self.xy, self.xh], [self.xy, self.yy, self.yh], [self.xh, self.yh, self.hh]])

    def turned(self, angle_rad: float) -> "PoseCovariance":
        """Return the same in a frame whose axes this one's become when they are turned by `-angle_rad`."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return PoseCovariance.of(turn @ self.matrix @ turn.T)

    @property
    def region_m(self) -> float:
        """Half the longest axis of the 95 % region's outline on the floor, metres."""
        return math.sqrt(FLOOR_REGION * float(np.linalg.eigvalsh(self.matrix[:2, :2])[-1]))

    @property
    def region_rad(self) -> float:
        """How far the 95 % region reaches in heading, to each side."""
        return math.sqrt(HEADING_REGION * self.hh)

    def holds(self, away: Pose) -> bool:
        """Whether the 95 % region about a pose holds another that is so far away: differences of x, y and heading."""
        place = np.array(away.position)
        on_floor = float(place @ np.linalg.solve(self.matrix[:2, :2], place)) <= FLOOR_REGION
        return on_floor and abs(math.remainder(away.heading_rad, math.tau)) <= self.region_rad


class Direction(StrEnum):
    """A way to move or turn a robot, as the robot itself faces."""

    FORWARD = "forward"
    BACKWARD = "backward"
    LEFT = "left"
    RIGHT = "right"
    TURN_LEFT = "turn left"
    TURN_RIGHT = "turn right"


@dataclass(frozen=True, slots=True)
class Arrow:
    """One thing to do to a robot that stands off its mark."""

    direction: Direction
    amount: float
    """Metres; degrees for a turn."""

    @property
    def turns(self) -> bool:
        """Whether it is a turn."""
        return self.direction in (Direction.TURN_LEFT, Direction.TURN_RIGHT)

    @property
    def words(self) -> str:
        """What to do."""
        return f"{self.direction} {self.amount:.0f}°" if self.turns else f"{100 * self.amount:.0f} cm {self.direction}"


@dataclass(frozen=True, slots=True)
class MeasuredPlacement:
    """Where a robot stands, and what follows from it."""

    start: int
    """Number of the starting position that it should stand at."""
    mark: Pose
    """Where it should stand, in the site's frame."""
    pose: Pose
    """Where it stands, in the site's frame."""
    covariance: PoseCovariance
    """In the site's frame."""
    tolerance: PlacementTolerance
    method: PlacementMethod
    looks: int
    """Depth images that it was measured from."""
    fits: bool = True
    """False where what is seen fits nowhere near the mark."""
    undetermined: tuple[str, ...] = ()
    """Directions that the view does not determine, in words, as the robot faces."""
    moved: tuple[str, ...] = ()
    """Ids of the site's objects that do not stand where the survey says."""
    depth_scale: float = 1.0
    """What the depth camera's metres have to be multiplied with."""
    took_s: float = 0.0

    @property
    def offset(self) -> Pose:
        """Where it stands as seen from the mark: x ahead of it, y to its left, heading counter-clockwise."""
        away = self.pose.relative_to(self.mark)
        return Pose(away.x_m, away.y_m, math.remainder(away.heading_rad, math.tau))

    @property
    def offset_covariance(self) -> PoseCovariance:
        """The covariance in the mark's frame."""
        return self.covariance.turned(-self.mark.heading_rad)

    @property
    def region_m(self) -> float:
        """Half the longest axis of the 95 % region on the floor, metres."""
        return self.covariance.region_m

    @property
    def region_deg(self) -> float:
        """Half the 95 % region's reach in heading, degrees."""
        return math.degrees(self.covariance.region_rad)

    def region_holds(self, pose: Pose) -> bool:
        """Whether a pose, in the site's frame, lies within the 95 % region."""
        here = self.pose
        return self.covariance.holds(
            Pose(pose.x_m - here.x_m, pose.y_m - here.y_m, pose.heading_rad - here.heading_rad)
        )

    @property
    def determined(self) -> bool:
        """Whether the measured pose can be taken for where the robot stands."""
        return self.fits and not self.undetermined

    @property
    def within_tolerance(self) -> bool:
        """Whether the whole 95 % region lies within the tolerance: green."""
        if not self.determined:
            return False
        inside_m = _farthest_m(self.offset, self.offset_covariance) <= self.tolerance.distance_m
        reach_deg = abs(self.offset.heading_deg) + self.region_deg
        return inside_m and reach_deg <= self.tolerance.heading_deg

    @property
    def arrows(self) -> tuple[Arrow, ...]:
        """What to do to the robot, largest need first; nothing that the measurement does not show to be needed."""
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
        """The result in a line."""
        if not self.fits:
            return f"what it sees fits nowhere near mark {self.start}"
        off_cm, off_deg = 100 * math.hypot(*self.offset.position), abs(self.offset.heading_deg)
        where = (
            f"{off_cm:.0f} cm (± {100 * self.region_m:.0f}) and {off_deg:.1f}° (± {self.region_deg:.1f}) off the mark"
        )
        if self.undetermined:
            return f"not determined: {' and '.join(self.undetermined)}"
        return f"stands right: {where}" if self.within_tolerance else where

    @property
    def wants_turn(self) -> bool:
        """Whether a turn on the spot is what to do next: one look does not say enough of where it stands."""
        if self.method is PlacementMethod.TURN or self.within_tolerance:
            return False
        return not self.determined or not self._is_off

    @property
    def advice(self) -> str:
        """What to do next; empty where it stands right."""
        turn = "turn on the spot" if self.wants_turn else "place it by eye"
        if not self.fits:
            return f"is it mark {self.start}? If it is, the plan and the room differ: {turn}"
        if self.undetermined:
            if self.method is PlacementMethod.TURN:
                return f"even all around too little is seen: {turn}"
            what = " and ".join(self.undetermined)
            verb = "are" if len(self.undetermined) > 1 else "is"
            return f"{what} {verb} not determined by what it sees from here: {turn}"
        if self.within_tolerance:
            return ""
        if self.wants_turn:
            return f"it may stand right, but one look is not sure enough: {turn}"
        return (
            ", ".join(arrow.words for arrow in self.arrows) or "it may stand right, but it is not sure: move it nearer"
        )

    @property
    def differs(self) -> str:
        """How plan and room differ; empty where they agree."""
        return f"the plan and the room differ here: {', '.join(self.moved)}" if self.moved else ""

    @property
    def _is_off(self) -> bool:
        off = self.offset
        worth_moving = math.hypot(*off.position) > self.tolerance.distance_m / 2
        return worth_moving or abs(off.heading_deg) > self.tolerance.heading_deg / 2

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        off = self.offset
        return {
            "start": self.start,
            "pose": {"x_m": self.pose.x_m, "y_m": self.pose.y_m, "heading_deg": self.pose.heading_deg},
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
            "took_s": self.took_s,
            "wants_turn": self.wants_turn,
            "headline": self.headline,
            "advice": self.advice,
            "differs": self.differs,
            "arrows": [
                {"direction": arrow.direction.value, "amount": arrow.amount, "words": arrow.words}
                for arrow in self.arrows
            ],
        }


_LEAST_WAY_M, _LEAST_TURN_DEG = 0.01, 0.5
"""Less than this nobody can mend by hand."""


def _farthest_m(offset: Pose, covariance: PoseCovariance) -> float:
    """Return how far from the mark the 95 % region reaches on the floor, metres."""
    values, axes = np.linalg.eigh(covariance.matrix[:2, :2])
    angles = np.linspace(0.0, math.tau, 72, endpoint=False)
    rim = axes @ (np.sqrt(FLOOR_REGION * np.maximum(values, 0.0))[:, None] * np.array([np.cos(angles), np.sin(angles)]))
    return float(np.hypot(rim[0] + offset.x_m, rim[1] + offset.y_m).max())
