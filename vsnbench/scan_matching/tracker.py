"""Follows a robot by odometry, corrected by the walls that it sees again; what odometry cannot have erred is refused.

The pose is the likeliest one given two things: odometry, with an uncertainty that grows as it drives and turns; and how
far the walls seen lie from those in the memory, along the way these face (point to line, so that nothing is pulled
along a wall). Where too few were seen before, right angles take their place if the walls stand at such: furniture is
turned a little off them, so that walls seen again know the heading better. How much too long odometry
counts ways and turns is estimated beside it (an extended Kalman filter of five numbers).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.scan_matching.wall_memory import WallMemory, from_right_angle, seen_from
from vsnbench.scan_matching.wall_pieces import WallPieces, pieces_of

_ITERATIONS: Final = 8
_LEAST_PIECES: Final = 12
_REACH_M: Final = 0.35
"""A piece is compared with what lies this near in place and facing."""
_MATCH_M: Final = 0.02
"""How far a piece seen again lies off, the two sights' own errors aside: furniture's edges, rounded corners."""
_AS_GOOD_AS: Final = 40.0
"""So many pieces' worth of knowledge has a look at most: their errors are not independent."""
_RIGHT_ANGLE_RAD: Final = math.radians(1.0)
"""How far a wall may be off its right angle, one standard deviation."""
_RIGHT_ANGLES_AS_GOOD_AS: Final = 16.0
_LEAST_SHARE: Final = 0.4
"""So much of what is compared has to fit."""
_REFUSED_SIGMAS: Final = 4.0
"""A correction of more than so many standard deviations of what odometry may have erred is none."""
_FLOOR: Final = np.diag([1e-4, 1e-4, 1e-3]) ** 2

Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OdometryTrust:
    """How far odometry may be off, standard deviations."""

    way_scale: float = 0.02
    """How much too long it counts every way, likewise `turn_scale`: one number for the whole drive."""
    turn_scale: float = 0.02
    way_share: float = 0.01
    """Of one way driven, beside that."""
    way_m: float = 0.003
    turn_share: float = 0.007
    turn_rad: float = math.radians(0.15)
    wander_rad_per_sqrt_m: float = 0.015
    """The heading's random walk along the way."""

    def spread(self, way: Pose) -> Numbers:
        """Return the (3, 3) covariance of one relative pose, in the frame it begins in, the scales aside."""
        way_m = math.hypot(*way.position)
        along_m = self.way_share * way_m + (self.way_m if way_m > 0 else 0.0)
        turned_rad = math.hypot(
            self.turn_share * way.heading_rad,
            self.wander_rad_per_sqrt_m * math.sqrt(way_m),
            self.turn_rad if way_m > 0 or way.heading_rad != 0 else 0.0,
        )
        across_m = math.hypot(along_m / 2, way_m * turned_rad / 2)
        return np.diag([along_m, across_m, turned_rad]) ** 2


@dataclass(frozen=True, slots=True)
class Followed:
    """Where a look was taken."""

    pose: Pose
    """In the map's frame."""
    corrected: bool
    """Whether walls that were seen before took part."""
    refused: bool
    """Whether the walls asked for a pose that odometry rules out: then it is odometry's."""


class WallTracker:
    """One drive; give it every look in order."""

    def __init__(self, trust: OdometryTrust | None = None) -> None:
        self._trust = trust if trust is not None else OdometryTrust()
        self._memory = WallMemory()
        self._odometry: Pose | None = None
        self._pose = Pose(0.0, 0.0, 0.0)
        self._scales = np.ones(2)
        """What ways and turns of odometry are multiplied with."""
        self._spread: Numbers = np.diag([0.0, 0.0, 0.0, self._trust.way_scale, self._trust.turn_scale]) ** 2
        """(5, 5) covariance: x, y, heading, scale of ways, scale of turns."""

    @property
    def scales(self) -> tuple[float, float]:
        """What odometry's ways and turns have to be multiplied with, as far as is known."""
        return float(self._scales[0]), float(self._scales[1])

    def follow(self, depth_m: npt.NDArray[np.float32], camera: Camera, odometry: Pose) -> Followed:
        """Take the next look; the frame of the map is the odometry's at the first one.

        Args:
            depth_m: (H, W) metres along the optical axis, NaN where invalid.
            camera: that took it.
            odometry: of the base when it was taken; its heading may be wrapped.
        """
        self._expect(odometry)
        expected = self._pose
        pieces = pieces_of(depth_m, camera)
        found = self._match(pieces)
        refused = found is not None and _sigmas(found[0], expected, self._spread[:3, :3]) > _REFUSED_SIGMAS
        if found is not None and not refused:
            self._take(*found)
        if not refused:
            self._memory.add(pieces, self._pose, self._spread[:3, :3])
        return Followed(self._pose, found is not None and not refused, refused)

    def _expect(self, odometry: Pose) -> None:
        """Go on by odometry alone."""
        before, self._odometry = self._odometry, odometry
        if before is None:
            self._pose = odometry
            return
        way = odometry.relative_to(before)
        ways, turns = self.scales
        way = Pose(way.x_m * ways, way.y_m * ways, math.remainder(way.heading_rad, math.tau) * turns)
        pose = self._pose.compose(way)
        dx, dy = pose.x_m - self._pose.x_m, pose.y_m - self._pose.y_m
        carried = np.eye(5)
        carried[0, 2:4], carried[1, 2:4], carried[2, 4] = (-dy, dx), (dx, dy), way.heading_rad
        cos, sin = math.cos(self._pose.heading_rad), math.sin(self._pose.heading_rad)
        turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        self._spread = carried @ self._spread @ carried.T
        self._spread[:3, :3] += turned @ self._trust.spread(way) @ turned.T
        self._pose = pose

    def _take(self, pose: Pose, spread: Numbers) -> None:
        """Go on from a pose that was measured with a (3, 3) covariance; the scales follow from the correction."""
        before = self._spread[:3, :3] + _FLOOR
        gain = np.linalg.solve(before, self._spread[:3, 3:]).T
        self._scales = self._scales + gain @ _difference(pose, self._pose)
        self._spread[3:, 3:] -= gain @ (before - spread) @ gain.T
        self._spread[3:, :3] = gain @ spread
        self._spread[:3, 3:] = self._spread[3:, :3].T
        self._spread[:3, :3] = spread
        self._pose = pose

    def _match(self, pieces: WallPieces) -> tuple[Pose, Numbers] | None:
        """Return the likeliest pose and its covariance; None where what is seen says nothing."""
        pose, before = self._pose, np.linalg.inv(self._spread[:3, :3] + _FLOOR)
        right_angle = self._memory.right_angle()
        knowledge = before
        for _ in range(_ITERATIONS):
            said = self._by_lines(pieces, pose)
            if said is None and right_angle is not None:
                said = _by_right_angles(pieces, pose, right_angle)
            if said is None:
                return None
            knowledge = before + said[0]
            step = np.linalg.solve(knowledge, -(before @ _difference(pose, self._pose) + said[1]))
            pose = Pose(pose.x_m + float(step[0]), pose.y_m + float(step[1]), pose.heading_rad + float(step[2]))
            if math.hypot(step[0], step[1]) < 2e-4 and abs(step[2]) < 1e-4:
                break
        return pose, np.linalg.inv(knowledge)

    def _by_lines(self, pieces: WallPieces, pose: Pose) -> tuple[Numbers, Numbers] | None:
        """Return what pieces seen again say of a pose: (3, 3) information, and (3,) the pull from where it fits."""
        memory = self._memory
        points, ways = seen_from(pieces, pose)
        nearest = memory.nearest(points, ways, _REACH_M)
        here = np.flatnonzero(nearest < len(memory))
        if len(here) < _LEAST_PIECES:
            return None
        there = nearest[here]
        facing = memory.facing_rad[there]
        normals = np.column_stack((np.cos(facing), np.sin(facing)))
        arms = points[here] - np.array(pose.position)
        off = np.einsum("ni,ni->n", points[here] - memory.points[there], normals)
        lever = np.column_stack((normals, normals[:, 1] * arms[:, 0] - normals[:, 0] * arms[:, 1]))
        error = np.sqrt(pieces.spread_m[here] ** 2 + memory.spread_m[there] ** 2 + _MATCH_M**2)
        if np.mean(np.abs(off) < 2.5 * error) < _LEAST_SHARE:
            return None
        doubt = 1 / (1 + (off / (2 * error)) ** 2) ** 2
        weight = doubt / error**2 * min(1.0, _AS_GOOD_AS / float(doubt.sum()))
        return (lever * weight[:, None]).T @ lever, lever.T @ (weight * off)


def _by_right_angles(pieces: WallPieces, pose: Pose, right_angle: float) -> tuple[Numbers, Numbers] | None:
    """Return what right angles say of a pose's heading, as `_by_lines` does; None where too little is at one."""
    off = from_right_angle(pieces.facing_rad + pose.heading_rad, right_angle)
    error = np.hypot(pieces.spread_rad, _RIGHT_ANGLE_RAD)
    near = np.abs(off) < 3 * error
    if near.sum() < _LEAST_PIECES or near.mean() < _LEAST_SHARE:
        return None
    doubt = 1 / (1 + (off / (2 * error)) ** 2) ** 2
    weight = np.where(near, doubt / error**2, 0.0)
    certain = float(weight.sum()) * min(1.0, _RIGHT_ANGLES_AS_GOOD_AS / float(doubt[near].sum()))
    return np.diag([0.0, 0.0, certain]), np.array([0.0, 0.0, certain * float(np.average(off, weights=weight))])


def _difference(one: Pose, other: Pose) -> Numbers:
    """Return (3,) how far a pose is from another in their common frame, the heading wrapped."""
    turned_rad = math.remainder(one.heading_rad - other.heading_rad, math.tau)
    return np.array([one.x_m - other.x_m, one.y_m - other.y_m, turned_rad])


def _sigmas(found: Pose, expected: Pose, spread: Numbers) -> float:
    """Return by how many standard deviations of a (3, 3) covariance a pose is away from the expected one."""
    away = _difference(found, expected)
    return math.sqrt(float(away @ np.linalg.solve(spread + np.diag([1e-3, 1e-3, 1e-3]) ** 2, away)))
