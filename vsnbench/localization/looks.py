"""Reduced depth images for matching, with their poses by odometry and their expected views."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.localization.twin import Floats, Twin
from vsnbench.simulator.rendering.renderer import DepthView, Pinhole, eye_of
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True, eq=False)
class DepthLook:
    """One depth image with the odometry at its time."""

    depth_m: npt.NDArray[np.floating[Any]]
    """(H, W) metres along the optical axis; NaN, infinite or 0 where invalid."""
    odometry: Pose
    """Odometry in the frame of the first look of a turn."""
    camera: Camera
    """Camera of the image; on a body that leans, those of two looks differ."""
    steps: tuple[Pose, ...] = ()
    """What the odometry measured of each step from this look to the first of the set; empty unless the robot drove."""


@dataclass(frozen=True, slots=True, eq=False)
class SmallLook:
    """A depth image of h x w block medians."""

    depth_m: Floats
    """(h, w) metres along the optical axis; NaN if at least half of a block is invalid."""
    pinhole: Pinhole
    across: Floats
    """(w,) to the right, metres per metre along the optical axis."""
    down: Floats
    """(h,)."""
    odometry: Pose
    camera: Camera
    steps: tuple[Pose, ...] = ()

    @classmethod
    def of(cls, look: DepthLook, width: int) -> "SmallLook":
        """Reduce a depth image to about a width; pixels outside whole blocks are cut off on all sides."""
        camera = look.camera
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
            camera,
            look.steps,
        )


@dataclass(frozen=True, slots=True, eq=False)
class LookSet:
    """Looks from one spot or from the last steps of a way, with the twin of the room."""

    twin: Twin
    looks: Sequence[SmallLook]
    """The pose of the first one is unknown."""

    @property
    def drove(self) -> bool:
        """Whether the robot drove between the looks, so that the odometry's errors in driving matter."""
        return any(look.steps for look in self.looks)

    def expected(self, look: SmallLook, pose: Pose) -> DepthView:
        """Return the expected view of a look at `pose`."""
        return self.twin.drawer.draw(eye_of(look.camera, pose), look.pinhole)


def _block_medians(depth: Floats, block: int, h: int, w: int) -> Floats:
    """Return the median of each block's valid pixels, (h, w)."""
    if block == 1:
        return depth
    blocks = depth.reshape(h, block, w, block).swapaxes(1, 2).reshape(h * w, block * block)
    ordered = np.sort(blocks, axis=1)  # NaN is sorted last
    valid = np.isfinite(ordered).sum(axis=1)
    middle = ordered[np.arange(h * w), np.maximum(valid - 1, 0) // 2]
    return np.where(valid * 2 > block * block, middle, np.nan).reshape(h, w)
