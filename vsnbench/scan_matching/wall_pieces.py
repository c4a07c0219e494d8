"""The upright surfaces of a depth image, seen from above: small pieces of wall with the way they face.

A plane's inverse depth is linear in the image, and a stereo or structured-light camera's error is about constant in it:
each small block of pixels is fitted so, and is kept where it is a plane that stands upright.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera

RANGE_M: Final = 5.0
"""Farther surfaces say too little about the robot's place."""
LOWEST_M, HIGHEST_M = 0.25, 2.4
"""Heights between which a surface counts."""
_BLOCKS_ACROSS: Final = 40
_PIXELS: Final = 8
"""Side of a block in the pixels that are looked at; a large image is thinned out."""
_LEAST_SEEN: Final = 0.6
"""Share of a block's pixels that have to be valid."""
_UPRIGHT: Final = 0.2
"""Largest vertical part of an upright surface's normal."""
_GRAZING: Final = 0.2
"""Surfaces seen at a smaller sine of the angle are not measured."""
_ROUGH_M, _ROUGH_PER_M = 0.008, 0.005
"""How far a block's pixels may lie off its plane: inverse metres, growing as the inverse of depth squared."""
_CELL_M: Final = 0.06
"""Pieces of one look that face alike within such a cell are one."""
_BEST_M, _BEST_RAD = 0.004, math.radians(0.7)
"""No piece is known better than this."""

Points = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class WallPieces:
    """Pieces of upright surfaces, from above."""

    points: Points
    """(n, 2) metres."""
    facing_rad: Points
    """(n,) the way each faces: out of the surface, towards who saw it."""
    spread_m: Points
    """(n,) standard deviation of its place along that way."""
    spread_rad: Points
    """(n,) standard deviation of the way it faces."""

    def __len__(self) -> int:
        return len(self.points)

    @property
    def normals(self) -> Points:
        """(n, 2) unit vectors of the way each faces."""
        return np.column_stack((np.cos(self.facing_rad), np.sin(self.facing_rad)))


def pieces_of(depth_m: npt.NDArray[np.float32], camera: Camera, range_m: float = RANGE_M) -> WallPieces:
    """Return the pieces of wall that a depth image shows, in the base's frame.

    Args:
        depth_m: (H, W) metres along the optical axis, NaN where invalid; any resolution of the camera's view.
        camera: the camera that took it.
        range_m: surfaces farther than this are left out.
    """
    blocks, left, down = _blocks(depth_m, camera)
    inverse, known = np.zeros_like(blocks), np.isfinite(blocks) & (blocks > 0)
    np.divide(1.0, blocks, out=inverse, where=known)
    side = np.arange(_PIXELS) - (_PIXELS - 1) / 2
    across, along = np.tile(side, _PIXELS), np.repeat(side, _PIXELS)
    terms = np.column_stack((np.ones_like(across), across, along))
    pairs = np.column_stack([terms[:, i] * terms[:, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))])
    seen = known.astype(np.float64)
    enough = seen.sum(axis=1) >= _LEAST_SEEN * _PIXELS**2
    seen, inverse, left, down = seen[enough], inverse[enough], left[enough], down[enough]
    square = (seen @ pairs)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    sums = inverse @ terms
    plane = np.linalg.solve(square, sums[..., None])[..., 0] if len(sums) else np.zeros((0, 3))
    rough = ((inverse - (plane @ terms.T) * seen) ** 2).sum(axis=1) / np.maximum(seen.sum(axis=1) - 3, 1)
    return _upright(plane, left, down, np.sqrt(rough), seen.sum(axis=1), camera, depth_m.shape[1], range_m)


def _blocks(depth_m: npt.NDArray[np.float32], camera: Camera) -> tuple[Points, Points, Points]:
    """Return (n, pixels) depth of the blocks, and (n,) where the middle of each looks, per metre of depth."""
    height, width = depth_m.shape
    skip = max(1, width // (_BLOCKS_ACROSS * _PIXELS))
    thin = depth_m[::skip, ::skip]
    rows, columns = thin.shape[0] // _PIXELS, thin.shape[1] // _PIXELS
    cut = thin[: rows * _PIXELS, : columns * _PIXELS].astype(np.float64)
    blocks = cut.reshape(rows, _PIXELS, columns, _PIXELS).swapaxes(1, 2).reshape(rows * columns, _PIXELS**2)
    focal_px = camera.focal_px * width / camera.width
    middle = (_PIXELS - 1) / 2 * skip
    left = ((width - 1) / 2 - middle - np.arange(columns) * _PIXELS * skip) / focal_px
    down = (middle + np.arange(rows) * _PIXELS * skip - (height - 1) / 2) / focal_px
    return blocks, np.tile(left, rows), np.repeat(down, columns)


def _upright(
    plane: Points,
    left: Points,
    down: Points,
    rough: Points,
    pixels: Points,
    camera: Camera,
    width: int,
    range_m: float,
) -> WallPieces:
    """Return the pieces among the planes, by their inverse depth in the middle of a block and its two slopes."""
    skip = max(1, width // (_BLOCKS_ACROSS * _PIXELS))
    step = skip * camera.width / (camera.focal_px * width)
    tilt_rad = math.radians(camera.tilt_deg)
    middle = np.maximum(plane[:, 0], 1e-6)
    # The plane is m . P = 1 for points P seen from the lens: its inverse depth is m's product with the pixel's ray.
    to_left, downwards = -plane[:, 1] / step, plane[:, 2] / step
    axis = middle - to_left * left - downwards * down
    m_ahead = axis * math.cos(tilt_rad) + downwards * math.sin(tilt_rad)
    m_up = axis * math.sin(tilt_rad) - downwards * math.cos(tilt_rad)
    length = np.sqrt(m_ahead**2 + to_left**2 + m_up**2)
    depth = 1 / middle
    ahead = depth * (math.cos(tilt_rad) + math.sin(tilt_rad) * down)
    beside = depth * left
    height = depth * (math.sin(tilt_rad) - math.cos(tilt_rad) * down) + camera.mount_height_m
    way = np.sqrt(ahead**2 + beside**2 + (height - camera.mount_height_m) ** 2)
    flat = np.hypot(m_ahead, to_left)
    kept = (plane[:, 0] > 1 / range_m) & (np.abs(m_up) < _UPRIGHT * length) & (1 / (length * way) > _GRAZING)
    kept &= (rough < _ROUGH_M * middle**2 + _ROUGH_PER_M) & (height > LOWEST_M) & (height < HIGHEST_M)
    error = np.maximum(rough, 1e-4) / np.sqrt(pixels)
    spread_m = np.hypot(error * depth**2, _BEST_M)
    spread_rad = np.hypot(error / (step * _PIXELS / math.sqrt(12)) / np.maximum(flat, 1e-6), _BEST_RAD)
    points = np.column_stack((ahead + camera.mount_forward_m, beside))
    facing = np.arctan2(-to_left, -m_ahead)
    return merged(WallPieces(points[kept], facing[kept], spread_m[kept], spread_rad[kept]), _CELL_M)


def merged(pieces: WallPieces, cell_m: float) -> WallPieces:
    """Return pieces of which those that face alike within a cell are one, their mean; at best as good as the best."""
    if not len(pieces):
        return pieces
    where = np.floor(pieces.points / cell_m).astype(np.int64)
    way = np.floor(pieces.facing_rad / (math.pi / 8)).astype(np.int64)
    _, of = np.unique(np.column_stack((where, way)), axis=0, return_inverse=True)
    of = of.ravel()
    count = int(of.max()) + 1
    weight = 1 / pieces.spread_m**2
    turn = 1 / pieces.spread_rad**2
    total, turns = np.bincount(of, weight, count), np.bincount(of, turn, count)
    points = np.column_stack([np.bincount(of, weight * axis, count) / total for axis in pieces.points.T])
    facing = np.arctan2(
        np.bincount(of, turn * np.sin(pieces.facing_rad), count),
        np.bincount(of, turn * np.cos(pieces.facing_rad), count),
    )
    many = np.bincount(of, minlength=count)
    # Of neighbouring blocks the errors are half their own and half shared.
    return WallPieces(
        points,
        facing,
        np.hypot(np.sqrt(1 / total), _BEST_M),
        np.hypot(np.sqrt(1 / turns), _BEST_RAD / np.sqrt(many)),
    )
