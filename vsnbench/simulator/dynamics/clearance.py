"""Fast lower bound of the distance from a point on the floor plan to the nearest solid."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.runtime.numba_cache import compiled
from vsnbench.simulator.furniture.canvas import rotation_matrix
from vsnbench.simulator.primitives import Primitive


class SolidDistances:
    """Distances to the bounding rectangles of the solids in a range of heights."""

    def __init__(self, solids: list[Primitive], low_m: float, high_m: float) -> None:
        self.solids = [solid for solid in solids if _in_band(solid, low_m, high_m)]
        footprints = [_footprint(solid) for solid in self.solids]
        self._centres, self._axes, self._half_sizes = (
            np.array([footprint[part] for footprint in footprints]).reshape(-1, 2) for part in range(3)
        )

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return a lower bound of the distance to the nearest solid; infinity if there is none."""
        if not self.solids:
            return float("inf")
        return float(_nearest_m(x_m, y_m, self._centres, self._axes, self._half_sizes))


@compiled
def _nearest_m(x_m: float, y_m: float, centres: Any, axes: Any, half_sizes: Any) -> float:
    """Return the distance from a point to the nearest rectangle; arrays (N, 2), first sides along `axes`."""
    nearest_m2 = np.inf
    for index in range(len(centres)):
        right_m, up_m = x_m - centres[index, 0], y_m - centres[index, 1]
        cos, sin = axes[index, 0], axes[index, 1]
        along_m = max(abs(cos * right_m + sin * up_m) - half_sizes[index, 0], 0.0)
        across_m = max(abs(cos * up_m - sin * right_m) - half_sizes[index, 1], 0.0)
        nearest_m2 = min(nearest_m2, along_m * along_m + across_m * across_m)
    return math.sqrt(nearest_m2)


def _in_band(solid: Primitive, low_m: float, high_m: float) -> bool:
    reach = float(np.abs(rotation_matrix(solid.rotation)[2]) @ np.array(solid.half_size))
    return solid.centre[2] + reach > low_m and solid.centre[2] - reach < high_m


def _footprint(
    solid: Primitive,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return centre, direction of the first side and half sizes of a rectangle around a solid's footprint."""
    axes = np.array(rotation_matrix(solid.rotation)[:2])
    side = axes[:, np.argmax(np.hypot(*axes))]
    side = side / np.hypot(*side)
    across = np.array([-side[1], side[0]])
    half = np.array([np.abs(side @ axes) @ solid.half_size, np.abs(across @ axes) @ solid.half_size])
    return np.array(solid.centre[:2]), side, half
