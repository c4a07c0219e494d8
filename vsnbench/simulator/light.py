"""The light that falls on every face of a scene, computed once for all pictures."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.mesh import Mesh


@dataclass(frozen=True, slots=True, eq=False)
class LightMaps:
    """A grid of light for each of F faces; its first and last cells lie on the face's edges."""

    start: npt.NDArray[np.int64]
    """(F,) first cell in `values`."""
    size: npt.NDArray[np.int32]
    """(F, 2) cells along s and t, at least two."""
    place: npt.NDArray[np.float64]
    """(F, 4): cell coordinate = (s * [0] + [1], t * [2] + [3])."""
    values: npt.NDArray[np.float32]
    """(N, 4) linear RGB and padding; 1 shows a surface in its own colour."""


def bake_light(mesh: Mesh) -> LightMaps:
    """Compute the light of a scene."""
    count = len(mesh.normals)
    size = np.full((count, 2), 2, np.int32)
    start = np.arange(count, dtype=np.int64) * 4
    spans = np.maximum(mesh.extent[:, 1::2] - mesh.extent[:, ::2], 1e-9)
    scale = (size - 1) / spans
    place = np.stack([scale[:, 0], -mesh.extent[:, 0] * scale[:, 0], scale[:, 1], -mesh.extent[:, 2] * scale[:, 1]], 1)
    level = 0.55 + 0.2 * mesh.normals[:, 2] + 0.12 * mesh.normals[:, 0] + 0.06 * mesh.normals[:, 1]
    values = np.repeat(level, 4)[:, None] * np.ones(4)
    return LightMaps(start, size, place, values.astype(np.float32))
