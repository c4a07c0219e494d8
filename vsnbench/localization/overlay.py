"""Overlay of the expected view at a mark on the live image: the twin's edges."""

import numpy as np
import numpy.typing as npt

from vsnbench.localization.twin import Twin, twin_of
from vsnbench.simulator.rendering.renderer import Pinhole, eye_of
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

_INK = (0, 229, 255)
"""Bright cyan: few rooms have this colour."""
_INK_ALPHA = 235
_STEP_SHARE, _CREASE = 0.05, 0.85
"""Minimum relative jump in depth of an edge, and maximum cosine between normals of a crease."""


def ghost(site: Site, camera: Camera, pose: Pose) -> npt.NDArray[np.uint8]:
    """Return (H, W, 4) red, green, blue, alpha: the edges of the expected view with the base at `pose`."""
    edges = edges_of(twin_of(site), camera, pose)
    image = np.zeros((*edges.shape, 4), np.uint8)
    image[edges] = (*_INK, _INK_ALPHA)
    return image


def laid_over(rgb: npt.NDArray[np.uint8], ghost_rgba: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return the image (H, W, 3) with an overlay of the same size."""
    alpha = ghost_rgba[..., 3:].astype(np.float32) / 255
    return np.asarray(np.rint(rgb * (1 - alpha) + ghost_rgba[..., :3] * alpha), np.uint8)


def edges_of(twin: Twin, camera: Camera, pose: Pose) -> npt.NDArray[np.bool_]:
    """Return (H, W) whether the twin's view has a step in depth, a crease, or a border between objects."""
    pinhole = Pinhole(camera.width, camera.height, camera.focal_px, *camera.center_px)
    view = twin.drawer.draw(eye_of(camera, pose), pinhole)
    depth_m, face = np.minimum(view.depth_m, np.float32(1e3)), np.maximum(view.face, 0)
    normal, thing = twin.normals[face].astype(np.float32), twin.object_of[face]
    edges = np.zeros(depth_m.shape, np.bool_)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
        nearer = np.minimum(depth_m[here], depth_m[there])
        step = np.abs(depth_m[here] - depth_m[there]) > _STEP_SHARE * nearer
        crease = (normal[here] * normal[there]).sum(axis=-1) < _CREASE
        differs = step | (thing[here] != thing[there]) | (crease & (thing[here] == 0))
        edges[here] |= differs
        edges[there] |= differs
    return edges
