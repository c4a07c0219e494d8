"""Images of a scene: RGB, depth, semantic and instance ids of one view in one pass."""

import math
import struct
import zlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.rendering.light import LightMaps, light_of
from vsnbench.simulator.rendering.mesh import Mesh, build_mesh
from vsnbench.simulator.rendering.textures import SKY, texture_atlas
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

_NOISE = 0.05
"""Standard deviation of the sensor's noise as a share of the light, before the image is softened."""
_GAIN = 1.15
"""Exposure of the film curve."""
_CONTRAST = 0.4
"""Share of an S-curve in the film curve."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One view; all images have the camera's size (H, W)."""

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    depth_m: npt.NDArray[np.float32]
    """(H, W) metres along the optical axis; infinite without a surface. No sensor range is applied."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame(Look):
    """One view with the labels of each pixel."""

    category: npt.NDArray[np.uint8]
    """(H, W) index into `mesh.SEMANTIC_CLASSES`."""
    instance: npt.NDArray[np.int32]
    """(H, W) 1 + index into `Site.objects`; 0 for the building."""


@dataclass(frozen=True, slots=True)
class Eye:
    """Camera pose in the site's frame; positive tilt looks up, positive roll is clockwise seen from behind."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    tilt_rad: float = 0.0
    roll_rad: float = 0.0


def eye_of(camera: Camera, pose: Pose) -> Eye:
    """Return the camera pose of a robot whose base is at `pose`."""
    mount = pose.compose(Pose(camera.mount_forward_m, 0.0))
    tilt_rad, roll_rad = math.radians(camera.tilt_deg), math.radians(camera.roll_deg)
    return Eye(mount.x_m, mount.y_m, camera.mount_height_m, mount.heading_rad, tilt_rad, roll_rad)


class Renderer:
    """Draws one scene from any pose. Light and textures are computed once; it has its own buffers and is not
    thread-safe.

    The same scene and view give the same pixels in every run.
    """

    def __init__(self, scene: Scene) -> None:
        self._mesh, self._light = _prepared(scene)
        self._atlas, self._levels = texture_atlas()
        self._tones = _tone_table()
        self._grain = _grain_table()
        self._surface = _surface(self._mesh, self._light)
        self._buffers: dict[tuple[int, int], tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]] = {}

    def render(self, camera: Camera, pose: Pose) -> Frame:
        """Draw the view of a robot's camera; `pose` is that of the base in the site's frame."""
        return self.render_from(eye_of(camera, pose), camera.width, camera.height, camera.focal_px)

    def render_from(self, eye: Eye, width: int, height: int, focal_px: float) -> Frame:
        """Draw the view of a pinhole camera at any pose."""
        from vsnbench.simulator.rendering.shading import label_pixels

        look, mesh = self._look(eye, width, height, focal_px), self._mesh
        category, instance = np.empty((height, width), np.uint8), np.empty((height, width), np.int32)
        label_pixels(self._buffers[height, width][1], mesh.owner, mesh.categories, mesh.instances, category, instance)
        return Frame(look.rgb, look.depth_m, category, instance)

    def look(self, camera: Camera, pose: Pose) -> Look:
        """Draw the view of a robot's camera without the simulator's labels."""
        return self._look(eye_of(camera, pose), camera.width, camera.height, camera.focal_px)

    def measure(self, camera: Camera, pose: Pose) -> npt.NDArray[np.float32]:
        """Return only the depth of `look`, (H, W) metres, without shading."""
        width, height = camera.width, camera.height
        self._find_faces(eye_of(camera, pose), width, height, camera.focal_px)
        with np.errstate(divide="ignore"):
            return np.reciprocal(self._buffers[height, width][0])

    def _look(self, eye: Eye, width: int, height: int, focal_px: float) -> Look:
        from vsnbench.simulator.rendering.shading import shade_pixels, soften

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
            self._grain,
            _seed_of(eye),
            look.rgb,
            look.depth_m,
        )
        soften(look.rgb)
        return look

    def _find_faces(
        self, eye: Eye, width: int, height: int, focal_px: float
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float, float]:
        """Write the face index and inverse depth of each pixel into the buffers; return camera position, axes and
        centre.
        """
        from vsnbench.simulator.rendering.raster import draw_faces

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
    """Return the arrays of faces and objects for `shade_pixels`, in its order."""
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
    """Return the camera's axes as rows: right, down, forward."""
    cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    level, rise = math.cos(eye.tilt_rad), math.sin(eye.tilt_rad)
    axes = np.array([[sin, -cos, 0.0], [cos * rise, sin * rise, -level], [cos * level, sin * level, rise]])
    if eye.roll_rad:
        right, down = axes[0].copy(), axes[1].copy()
        axes[0] = math.cos(eye.roll_rad) * right + math.sin(eye.roll_rad) * down
        axes[1] = math.cos(eye.roll_rad) * down - math.sin(eye.roll_rad) * right
    return axes


def _seed_of(eye: Eye) -> int:
    """Return the seed of an image's noise: the same for poses that differ only by rounding errors."""
    place = (eye.x_m, eye.y_m, eye.z_m, eye.heading_rad, eye.tilt_rad, eye.roll_rad)
    return zlib.crc32(struct.pack("<6q", *(round(value * 1e5) for value in place)))


def _grain_table() -> npt.NDArray[np.float32]:
    """Return the factors of the sensor's noise, (GRAIN + STRETCH, 4), so that any stretch of a row is one slice."""
    from vsnbench.simulator.rendering.shading import GRAIN, STRETCH

    uniform = np.random.default_rng(0).integers(-500, 501, (GRAIN, 4, 4)).sum(2)  # nearly normal, deviation 577
    factors = np.asarray(1 + uniform * (_NOISE / 577), np.float32)
    return np.concatenate([factors, factors[:STRETCH]])


def _tone_table() -> npt.NDArray[np.uint8]:
    """Return sRGB for light from 0 to 2: a film curve with a toe and a long shoulder."""
    from vsnbench.simulator.rendering.shading import TONES

    light = (np.arange(TONES) + 0.5) * 2 / TONES * _GAIN
    knee, top = 0.42, 1.0
    over = np.maximum(light - knee, 0)
    rolled = np.where(light < knee, light, knee + (top - knee) * (1 - np.exp(-over / (top - knee))))
    srgb = np.where(rolled <= 0.0031308, 12.92 * rolled, 1.055 * rolled ** (1 / 2.4) - 0.055)
    srgb = srgb / srgb[-1]
    srgb += _CONTRAST * (srgb * srgb * (3 - 2 * srgb) - srgb)
    return np.asarray(np.clip(np.rint(srgb * 255), 0, 255), np.uint8)
