"""Depth images, made small: what the matcher works on, with where they were taken from and what they should show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.placement.twin import Twin
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.simulator.depth_view import DepthView, Pinhole
from vsnbench.simulator.renderer import eye_of

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class DepthLook:
    """One depth image, and the odometry where it was taken."""

    depth_m: npt.NDArray[np.floating[Any]]
    """(H, W) metres along the optical axis; NaN, infinite or 0 where invalid."""
    odometry: Pose
    """In the frame of the first look of a turn."""


@dataclass(frozen=True, slots=True, eq=False)
class SmallLook:
    """A depth image of h x w block medians."""

    depth_m: Floats
    """(h, w) metres along the optical axis; NaN where half a block or more is invalid."""
    pinhole: Pinhole
    across: Floats
    """(w,) to the right, metres per metre along the optical axis."""
    down: Floats
    """(h,)."""
    odometry: Pose

    @classmethod
    def of(cls, look: DepthLook, camera: Camera, width: int) -> "SmallLook":
        """Shrink a depth image of `camera` to about that width; what does not fill a block is cut off all around."""
        rows, columns = look.depth_m.shape
        block = max(1, round(columns / width))
        h, w = rows // block, columns // block
        top, left = (rows - h * block) // 2, (columns - w * block) // 2
        depth = np.array(look.depth_m[top : top + h * block, left : left + w * block], np.float64)
        depth[~np.isfinite(depth) | (depth < camera.depth_min_m) | (depth <= 0) | (depth > camera.depth_max_m)] = np.nan
        focal_px = camera.focal_px * columns / camera.width / block
        pinhole = Pinhole(
            w,
            h,
            focal_px,
            ((columns - 1) / 2 - left + 0.5) / block - 0.5,
            ((rows - 1) / 2 - top + 0.5) / block - 0.5,
        )
        return cls(
            _block_medians(depth, block, h, w),
            pinhole,
            (np.arange(w) - pinhole.centre_x) / focal_px,
            (np.arange(h) - pinhole.centre_y) / focal_px,
            look.odometry,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What one camera saw from a spot, and the twin of the room, which says what it should have seen."""

    twin: Twin
    camera: Camera
    looks: Sequence[SmallLook]
    """The first is the one whose pose is sought."""

    def expected(self, look: SmallLook, pose: Pose) -> DepthView:
        """Return what a look should show that was taken at `pose`."""
        return self.twin.drawer.draw(eye_of(self.camera, pose), look.pinhole)


def _block_medians(depth: Floats, block: int, h: int, w: int) -> Floats:
    """Return the median of each block's valid pixels, (h, w)."""
    if block == 1:
        return depth
    blocks = depth.reshape(h, block, w, block).swapaxes(1, 2).reshape(h * w, block * block)
    ordered = np.sort(blocks, axis=1)  # NaN last
    valid = np.isfinite(ordered).sum(axis=1)
    middle = ordered[np.arange(h * w), np.maximum(valid - 1, 0) // 2]
    return np.where(valid * 2 > block * block, middle, np.nan).reshape(h, w)
