"""Pictures of a scene: RGB, depth, semantic and instance ids of one view, in one pass."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.simulator.light import LightMaps, light_of
from vsnbench.simulator.mesh import Mesh, build_mesh
from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.textures import SKY, texture_atlas


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One view as a camera has it; all images have the camera's size (H, W)."""

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    depth_m: npt.NDArray[np.float32]
    """(H, W) metres along the optical axis; infinite where there is nothing. No sensor's range is applied."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame(Look):
    """One view, with what each pixel shows."""

    category: npt.NDArray[np.uint8]
    """(H, W) index into `mesh.SEMANTIC_CLASSES`."""
    instance: npt.NDArray[np.int32]
    """(H, W) 1 + index into `Site.objects`; 0 for the building."""


@dataclass(frozen=True, slots=True)
class Eye:
    """Where a picture is taken from, in the site's frame; a positive tilt looks up."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    tilt_rad: float = 0.0


def eye_of(camera: Camera, pose: Pose) -> Eye:
    """Return where the camera of a robot is whose base stands at `pose`."""
    mount = pose.compose(Pose(camera.mount_forward_m, 0.0))
    return Eye(mount.x_m, mount.y_m, camera.mount_height_m, mount.heading_rad, math.radians(camera.tilt_deg))


class Renderer:
    """Draws one scene from anywhere. Light and textures are computed once; buffers are its own, one thread at a time.

    The same scene and view give the same pixels on every run.
    """

    def __init__(self, scene: Scene) -> None:
        self._mesh, self._light = _prepared(scene)
        self._atlas, self._levels = texture_atlas()
        self._tones = _tone_table()
        self._surface = _surface(self._mesh, self._light)
        self._buffers: dict[tuple[int, int], tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]] = {}

    def render(self, camera: Camera, pose: Pose) -> Frame:
        """Draw what a robot's camera sees; `pose` is that of the base in the site's frame."""
        return self.render_from(eye_of(camera, pose), camera.width, camera.height, camera.focal_px)

    def render_from(self, eye: Eye, width: int, height: int, focal_px: float) -> Frame:
        """Draw what a pinhole camera sees from any place."""
        from vsnbench.simulator.shading import label_pixels

        look, mesh = self._look(eye, width, height, focal_px), self._mesh
        category, instance = np.empty((height, width), np.uint8), np.empty((height, width), np.int32)
        label_pixels(self._buffers[height, width][1], mesh.owner, mesh.categories, mesh.instances, category, instance)
        return Frame(look.rgb, look.depth_m, category, instance)

    def look(self, camera: Camera, pose: Pose) -> Look:
        """Draw what a robot's camera sees, without the labels that only a simulator has."""
        return self._look(eye_of(camera, pose), camera.width, camera.height, camera.focal_px)

    def measure(self, camera: Camera, pose: Pose) -> npt.NDArray[np.float32]:
        """Return only the depth that `look` gives, (H, W) metres: nobody has to know what colour anything is."""
        width, height = camera.width, camera.height
        self._find_faces(eye_of(camera, pose), width, height, camera.focal_px)
        with np.errstate(divide="ignore"):
            return np.reciprocal(self._buffers[height, width][0])

    def _look(self, eye: Eye, width: int, height: int, focal_px: float) -> Look:
        from vsnbench.simulator.shading import shade_pixels

        at, axes, cx, cy = self._find_faces(eye, width, height, focal_px)
        nearness, seen = self._buffers[height, width]
        look = Look(np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32))
        shade_pixels(
            at,
            axes,
            focal_px,
            cx,
            cy,
            nearness,
            seen,
            self._surface,
            self._light.values,
            self._atlas,
            self._levels,
            SKY,
            self._tones,
            look.rgb,
            look.depth_m,
        )
        return look

    def _find_faces(
        self, eye: Eye, width: int, height: int, focal_px: float
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float, float]:
        """Write into the buffers which face each pixel sees, and how near; return the camera's place, axes, centre."""
        from vsnbench.simulator.raster import draw_faces

        mesh = self._mesh
        if (height, width) not in self._buffers:
            self._buffers[height, width] = (np.empty((height, width), np.float32), np.empty((height, width), np.int32))
        nearness, seen = self._buffers[height, width]
        at = np.array([eye.x_m, eye.y_m, eye.z_m])
        axes = camera_axes(eye)
        cx, cy = (width - 1) / 2, (height - 1) / 2
        draw_faces(
            at,
            axes,
            focal_px,
            cx,
            cy,
            mesh.corners,
            mesh.normals,
            mesh.centres,
            mesh.radii,
            mesh.faces,
            nearness,
            seen,
        )
        return at, axes, cx, cy


@lru_cache(maxsize=8)
def _prepared(scene: Scene) -> tuple[Mesh, LightMaps]:
    mesh = build_mesh(scene)
    return mesh, light_of(scene, mesh)


def _surface(mesh: Mesh, light: LightMaps) -> tuple[npt.NDArray[Any], ...]:
    """Return what `shade_pixels` asks of faces and of their owners, in its order."""
    tints = np.zeros((len(mesh.colors), 4), np.float32)
    tints[:, :3] = mesh.colors
    return (
        mesh.normals,
        mesh.axis_s,
        mesh.axis_t,
        mesh.texture,
        mesh.texture_map,
        mesh.owner,
        tints,
        mesh.glow.astype(np.float32),
        light.start,
        light.size,
        light.place,
    )


def camera_axes(eye: Eye) -> npt.NDArray[np.float64]:
    """Return the rows right, down, forward."""
    cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    level, rise = math.cos(eye.tilt_rad), math.sin(eye.tilt_rad)
    return np.array([[sin, -cos, 0.0], [cos * rise, sin * rise, -level], [cos * level, sin * level, rise]])


def _tone_table() -> npt.NDArray[np.uint8]:
    """Return sRGB for light from 0 to 2, straight up to the middle tones and rolling off above them."""
    from vsnbench.simulator.shading import TONES

    light = (np.arange(TONES) + 0.5) * 2 / TONES
    knee, top = 0.55, 1.0
    over = np.maximum(light - knee, 0)
    rolled = np.where(light < knee, light, knee + (top - knee) * (1 - np.exp(-over / (top - knee))))
    srgb = np.where(rolled <= 0.0031308, 12.92 * rolled, 1.055 * rolled ** (1 / 2.4) - 0.055)
    return np.asarray(np.clip(np.rint(srgb * 255), 0, 255), np.uint8)
