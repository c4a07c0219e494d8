"""What a robot senses before each action, and nothing that a real one could not know."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose


class Sensor(StrEnum):
    """A kind of measurement that a policy can need and a robot can offer."""

    RGB = "rgb"
    DEPTH = "depth"
    ODOMETRY = "odometry"
    INSTANCES = "instances"
    """Per-pixel object instances: only a simulator has them; for the simulated detector."""


@dataclass(frozen=True, slots=True, eq=False)
class InstanceImage:
    """The simulator's own labels: which object each pixel shows."""

    ids: npt.NDArray[np.int32]
    """(H, W); 0 is nothing of interest, k > 0 the k-th object of the site."""
    categories: Mapping[int, str]
    """The category of each id that can occur."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One look at the world.

    Raises:
        ValueError: an array has the wrong shape or type.
    """

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) uint8."""
    depth_m: npt.NDArray[np.float32] | None
    """(H, W) float32, metres along the optical axis, NaN where invalid; None without a depth camera."""
    pose: Pose
    """Odometry relative to the start of the episode."""
    stamp_s: float
    """When the image was taken; seconds on the robot's clock."""
    camera: Camera
    instances: InstanceImage | None = None
    depth_stamp_s: float | None = None
    """When the depth image was taken, where the two are not synchronised."""
    sensing: Mapping[str, float] = field(default_factory=dict)
    """How the look came about (frames filtered, seconds waited and computed, skew), for the record."""

    def __post_init__(self) -> None:
        if self.rgb.ndim != 3 or self.rgb.shape[2] != 3 or self.rgb.dtype != np.uint8:
            raise ValueError(f"rgb must be (H, W, 3) uint8, not {self.rgb.shape} {self.rgb.dtype}")
        if self.depth_m is not None and (self.depth_m.ndim != 2 or self.depth_m.dtype != np.float32):
            raise ValueError(f"depth must be (H, W) float32, not {self.depth_m.shape} {self.depth_m.dtype}")
