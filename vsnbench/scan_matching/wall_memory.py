"""The walls seen so far, as pieces in the map's frame, and the directions in which most of them run."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from vsnbench.protocol.pose import Pose
from vsnbench.scan_matching.wall_pieces import Points, WallPieces

_CELL_M: Final = 0.06
_SECTORS: Final = 16
"""Ways of facing that are kept apart in one cell."""
_FACING_M: Final = 0.3
"""So many metres apart count two pieces that face 1 radian apart."""
_RIGHT_ANGLES: Final = 0.5
"""So strongly have the walls to run in two directions at a right angle."""
_NEARER_RAD: Final = (math.radians(4), math.radians(2), math.radians(1))
_LEAST_PIECES: Final = 20
_OFFSET: Final = 1 << 20


class WallMemory:
    """Pieces of walls in the map's frame; what is seen again is averaged by how well each sight of it was known."""

    def __init__(self) -> None:
        self._at: dict[int, int] = {}
        self._sums = np.zeros((0, 6))
        """Sums of weight, weighted x, y; of turn weight, weighted cosine and sine of the way it faces."""
        self._tree: cKDTree | None = None

    def __len__(self) -> int:
        return len(self._sums)

    def add(self, pieces: WallPieces, pose: Pose, spread: npt.NDArray[np.float64]) -> None:
        """Add pieces seen from a pose.

        Args:
            pieces: in the base's frame.
            pose: of the base in the map's frame.
            spread: (3, 3) covariance of that pose: x, y, heading.
        """
        if not len(pieces):
            return
        points, facing = seen_from(pieces, pose)
        normals = np.column_stack((np.cos(facing), np.sin(facing)))
        lever = np.column_stack((normals, _lever(points - np.array(pose.position), normals)))
        weight = 1 / (pieces.spread_m**2 + np.einsum("ni,ij,nj->n", lever, spread, lever))
        turn = 1 / (pieces.spread_rad**2 + spread[2, 2])
        rows = np.column_stack(
            (weight, weight[:, None] * points, turn, turn[:, None] * np.column_stack((np.cos(facing), np.sin(facing))))
        )
        cells = np.floor(points / _CELL_M).astype(np.int64) + _OFFSET
        sector = np.floor(facing / (math.tau / _SECTORS)).astype(np.int64) % _SECTORS
        keys = ((cells[:, 0] * 2 * _OFFSET + cells[:, 1]) * _SECTORS + sector).tolist()
        at = np.array([self._at.setdefault(key, len(self._at)) for key in keys])
        if len(self._at) > len(self._sums):
            self._sums = np.vstack((self._sums, np.zeros((len(self._at) - len(self._sums), 6))))
        np.add.at(self._sums, at, rows)
        self._tree = None

    def nearest(self, points: Points, facing_rad: Points, within_m: float) -> npt.NDArray[np.intp]:
        """Return (n,) which piece is nearest to each in place and facing; `len(self)` where none is near."""
        if self._tree is None:
            self._tree = cKDTree(_placed(self.points, self.facing_rad))
        _, found = self._tree.query(_placed(points, facing_rad), distance_upper_bound=within_m)
        return np.asarray(found, np.intp)

    @property
    def points(self) -> Points:
        """(n, 2) metres in the map's frame."""
        return np.asarray(self._sums[:, 1:3] / self._sums[:, :1], np.float64)

    @property
    def facing_rad(self) -> Points:
        """(n,) the way each faces."""
        return np.asarray(np.arctan2(self._sums[:, 5], self._sums[:, 4]), np.float64)

    @property
    def spread_m(self) -> Points:
        """(n,) standard deviation of each along the way it faces."""
        return np.asarray(1 / np.sqrt(self._sums[:, 0]), np.float64)

    def right_angle(self) -> float | None:
        """Return the direction, from 0 to a right angle, that most walls run along or across; None without such."""
        if len(self) < _LEAST_PIECES:
            return None
        weight, facing = self._sums[:, 3], self.facing_rad
        four = np.array([np.cos(4 * facing) @ weight, np.sin(4 * facing) @ weight]) / weight.sum()
        if math.hypot(*four) < _RIGHT_ANGLES:
            return None
        found = math.atan2(four[1], four[0]) / 4
        for within_rad in _NEARER_RAD:
            off = from_right_angle(facing, found)
            near = np.abs(off) < within_rad
            found += float(np.average(off[near], weights=weight[near])) if near.any() else 0.0
        return found


def seen_from(pieces: WallPieces, pose: Pose) -> tuple[Points, Points]:
    """Return (n, 2) points and (n,) ways of facing of pieces in the frame in which a pose is given."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    points = pieces.points @ np.array([[cos, sin], [-sin, cos]]) + np.array(pose.position)
    return points, pieces.facing_rad + pose.heading_rad


def from_right_angle(angles_rad: Points, direction_rad: float) -> Points:
    """Return how far angles are off the nearest of four directions at right angles."""
    quarter = math.pi / 2
    return np.asarray((angles_rad - direction_rad + quarter / 2) % quarter - quarter / 2, np.float64)


def _lever(arms: Points, normals: Points) -> Points:
    """Return how far points go along their normals per radian of turning."""
    return np.asarray(normals[:, 1] * arms[:, 0] - normals[:, 0] * arms[:, 1], np.float64)


def _placed(points: Points, facing_rad: Points) -> Points:
    return np.column_stack((points, _FACING_M * np.cos(facing_rad), _FACING_M * np.sin(facing_rad)))
