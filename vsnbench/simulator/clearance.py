"""A quick lower bound of how far a point of the floor plan is from anything that a robot could touch."""

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.primitives import Primitive, Quaternion


class Clearance:
    """Distances to the footprints of the solids in a band of heights, each bounded by a rectangle."""

    def __init__(self, solids: list[Primitive], low_m: float, high_m: float) -> None:
        self.solids = [solid for solid in solids if _in_band(solid, low_m, high_m)]
        footprints = [_footprint(solid) for solid in self.solids]
        self._centres, self._axes, self._half_sizes = (
            np.array([footprint[part] for footprint in footprints]).reshape(-1, 2) for part in range(3)
        )

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return a distance that is at most the one to the nearest solid; infinite where there is none."""
        if not self.solids:
            return float("inf")
        away = np.array([x_m, y_m]) - self._centres
        cos, sin = self._axes[:, 0], self._axes[:, 1]
        local = np.column_stack((cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]))
        outside = np.maximum(np.abs(local) - self._half_sizes, 0.0)
        return float(np.sqrt((outside**2).sum(axis=1).min()))


def _in_band(solid: Primitive, low_m: float, high_m: float) -> bool:
    reach = float(np.abs(_rotation(solid.rotation)[2]) @ np.array(solid.half_size))
    return solid.centre[2] + reach > low_m and solid.centre[2] - reach < high_m


def _footprint(
    solid: Primitive,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the centre, the direction of the first side, and the half sizes of a rectangle around the shadow."""
    axes = _rotation(solid.rotation)[:2]
    side = axes[:, np.argmax(np.hypot(*axes))]
    side = side / np.hypot(*side)
    across = np.array([-side[1], side[0]])
    half = np.array([np.abs(side @ axes) @ solid.half_size, np.abs(across @ axes) @ solid.half_size])
    return np.array(solid.centre[:2]), side, half


def _rotation(quaternion: Quaternion) -> npt.NDArray[np.float64]:
    """Return the matrix whose columns are the rotated axes."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
