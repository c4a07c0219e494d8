"""Evidence of free space: pixels that must have depth before a forward move.

A ray through the swath ahead of the robot that meets the floor within the camera's range must have depth: of the floor
or of an obstacle. Without depth, the sensor is blind or an obstacle is nearer than its minimum range. Rays towards a
far wall are no evidence, because the wall may be out of range; they count only if the camera sees no floor.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.parameters import DepthGuard
from vsnbench.values.camera import Camera

MIN_VALID_SHARE = 0.1
"""Minimum share of valid pixels in an image or in a cell of it that is not blind."""
MIN_HIDDEN_CELLS = 2
"""Minimum number of cells without depth that can hide an obstacle; a single one may be a dark object."""
OBSTACLE_WIDTH_M = 0.05
"""Width of the narrowest obstacle that must be detected by its invalid pixels: the leg of a table."""
_BORDER_SHARE = 0.08
"""Share of width and height on each side where depth that is aligned to colour is missing."""
_FLOOR_RANGE_SHARE = 0.5
"""Share of the camera's range; depth of a more distant floor, seen at a low angle, is unreliable."""
_MIN_FLOOR_SHARE = 0.05
"""Minimum share of pixels on the floor for a camera that sees the floor."""
_MIN_CELL_PIXELS = 32
_MIN_CELL_SIDE = 8
_NEAREST_M = 0.3
"""Assumed minimum range, for the size of cells, of a camera whose profile gives none."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Evidence in one depth image."""

    pixels: int
    """Number of pixels that must have depth; 0 for a camera that does not see the swath."""
    valid_share: float
    """Share of these pixels with valid depth."""
    hidden: npt.NDArray[np.bool_]
    """(cells,) whether a cell has too few valid pixels."""
    first_row: int
    """First image row with such pixels."""

    @property
    def is_blind(self) -> bool:
        """Whether the image has too little depth in the swath."""
        return self.valid_share < MIN_VALID_SHARE

    @property
    def hidden_cells(self) -> int:
        """Number of cells with too few valid pixels."""
        return int(np.count_nonzero(self.hidden))

    @property
    def hides_something(self) -> bool:
        """Whether the part without depth can hide an obstacle."""
        return self.hidden_cells >= MIN_HIDDEN_CELLS


@dataclass(frozen=True, slots=True, eq=False)
class EvidencePixels:
    """Pixels of one camera and image size that must have depth, in square cells."""

    first_row: int
    """First image row of `cells`."""
    cells: npt.NDArray[np.int32]
    """(rows, W) cell number of each pixel; -1 for other pixels, the last number for all small cells."""
    pixels: npt.NDArray[np.int64]
    """(N,) number of pixels of each cell; the last is for all small cells together."""

    def read(self, depth_m: npt.NDArray[np.float32], camera: Camera) -> Evidence:
        """Return the evidence in a depth image (H, W); depth beyond the camera's range is not valid."""
        from vsnbench.values.encoding.depth_kernels import count_valid_in_cells

        valid = np.zeros(self.pixels.size, np.int64)
        rows = depth_m[self.first_row : self.first_row + self.cells.shape[0]]
        count_valid_in_cells(rows, self.cells, np.float32(camera.depth_max_m), valid)
        pixels = int(self.pixels.sum())
        hidden = valid[:-1] < MIN_VALID_SHARE * self.pixels[:-1]
        return Evidence(pixels, float(valid.sum() / pixels) if pixels else 0.0, hidden, self.first_row)


@lru_cache(maxsize=16)
def evidence_pixels(camera: Camera, width: int, height: int, radius_m: float, guard: DepthGuard) -> EvidencePixels:
    """Return the pixels that must have depth before a forward move.

    Args:
        camera: camera at any resolution.
        width: width of the depth image, pixels.
        height: height of the depth image, pixels.
        radius_m: radius of the robot.
        guard: the swath ahead of the robot's front.
    """
    in_swath = _rays_through_swath(camera, width, height, radius_m, guard)
    in_swath[: round(_BORDER_SHARE * height)] = False
    in_swath[height - round(_BORDER_SHARE * height) :] = False
    in_swath[:, : round(_BORDER_SHARE * width)] = False
    in_swath[:, width - round(_BORDER_SHARE * width) :] = False
    for range_share in (_FLOOR_RANGE_SHARE, 0.9):
        on_floor = in_swath & _rays_to_floor(camera, width, height, range_share * camera.depth_max_m)
        if np.count_nonzero(on_floor) >= _MIN_FLOOR_SHARE * width * height:
            return _in_cells(on_floor, _cell_side(camera, width))
    return _in_cells(in_swath, _cell_side(camera, width))


def _rays_through_swath(
    camera: Camera, width: int, height: int, radius_m: float, guard: DepthGuard
) -> npt.NDArray[np.bool_]:
    """Return which rays (H, W) pass through the box that must be free."""
    rays = camera.rays(width, height)
    ahead, up, left = rays.ahead[:, None], rays.up[:, None], np.abs(rays.left)[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        enters = np.maximum((radius_m - rays.forward_m) / ahead, 0.0)
        leaves = np.minimum((radius_m + guard.distance_m - rays.forward_m) / ahead, (radius_m + guard.margin_m) / left)
        lowest = (guard.min_height_m - rays.height_m) / up
        highest = (guard.max_height_m - rays.height_m) / up
    enters = np.maximum(enters, np.fmin(lowest, highest))
    leaves = np.minimum(leaves, np.fmax(lowest, highest))
    return np.asarray((leaves >= enters) & (leaves > 0) & (ahead > 0))


def _rays_to_floor(camera: Camera, width: int, height: int, farthest_m: float) -> npt.NDArray[np.bool_]:
    """Return in which rows (H, 1) rays meet the floor between the camera's minimum range and `farthest_m`."""
    rays = camera.rays(width, height)
    with np.errstate(divide="ignore"):
        depth_m = np.where(rays.up < 0, rays.height_m / -rays.up, math.inf)
    return np.asarray((depth_m >= camera.depth_min_m) & (depth_m <= farthest_m))[:, None]


def _cell_side(camera: Camera, width: int) -> int:
    """Return half the width in pixels of a narrow obstacle at the camera's minimum range."""
    focal_px = camera.focal_px * width / camera.width
    return max(_MIN_CELL_SIDE, round(focal_px * OBSTACLE_WIDTH_M / max(camera.depth_min_m, _NEAREST_M) / 2))


def _in_cells(chosen: npt.NDArray[np.bool_], side: int) -> EvidencePixels:
    """Return the chosen pixels (H, W) in cells that begin at the image's lower left corner."""
    rows, columns = np.nonzero(chosen)
    if rows.size == 0:
        return EvidencePixels(0, np.full((1, chosen.shape[1]), -1, np.int32), np.zeros(1, np.int64))
    first, last = int(rows.min()), int(rows.max())
    across = -(-chosen.shape[1] // side)
    _, numbers, sizes = np.unique(
        (last - rows) // side * across + columns // side, return_inverse=True, return_counts=True
    )
    whole = sizes >= max(_MIN_CELL_PIXELS, side * side // 2)
    renumbered = np.where(whole, np.cumsum(whole) - 1, np.count_nonzero(whole))
    cells = np.full((last - first + 1, chosen.shape[1]), -1, np.int32)
    cells[rows - first, columns] = renumbered[numbers]
    return EvidencePixels(first, cells, np.append(sizes[whole], sizes[~whole].sum()).astype(np.int64))
