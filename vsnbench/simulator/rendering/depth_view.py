"""Fast views with depth and face indices only, without light and textures: hundreds per second."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.rendering.mesh import Mesh
from vsnbench.simulator.rendering.renderer import Eye, camera_axes


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A pinhole camera: image size, focal length and principal point, pixels."""

    width: int
    height: int
    focal_px: float
    centre_x: float
    centre_y: float


@dataclass(frozen=True, slots=True, eq=False)
class DepthView:
    """One view, (H, W)."""

    depth_m: npt.NDArray[np.float32]
    """Metres along the optical axis; infinite without a surface."""
    face: npt.NDArray[np.int32]
    """Index of the mesh's face; -1 without a surface."""


class DepthDrawer:
    """Draws one mesh from any pose; it has its own buffers and is not thread-safe."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._buffers: dict[tuple[int, int], tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]] = {}

    def draw(self, eye: Eye, pinhole: Pinhole) -> DepthView:
        """Draw a view from a pose; the next view of the same size overwrites its arrays."""
        from vsnbench.simulator.rendering.raster import draw_faces

        mesh, size = self.mesh, (pinhole.height, pinhole.width)
        if size not in self._buffers:
            self._buffers[size] = (np.empty(size, np.float32), np.empty(size, np.int32))
        nearness, seen = self._buffers[size]
        at = np.array([eye.x_m, eye.y_m, eye.z_m])
        draw_faces(
            at,
            camera_axes(eye),
            pinhole.focal_px,
            pinhole.centre_x,
            pinhole.centre_y,
            mesh.corners,
            mesh.normals,
            mesh.centres,
            mesh.radii,
            mesh.faces,
            nearness,
            seen,
        )
        with np.errstate(divide="ignore"):
            return DepthView(np.float32(1) / nearness, seen)
