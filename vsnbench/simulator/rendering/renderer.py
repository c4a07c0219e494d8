"""Images of a scene: RGB, depth and object of each pixel of one view in one pass."""

import math
import struct
import zlib
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SiteError
from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.rendering.light import LightMaps, light_of
from vsnbench.simulator.rendering.mesh import Mesh, build_mesh
from vsnbench.simulator.rendering.scan.drawing import ScanDrawer, View
from vsnbench.simulator.rendering.scan.mesh import load_scan
from vsnbench.simulator.rendering.textures import SKY, texture_atlas
from vsnbench.values.camera import Camera
from vsnbench.values.pose import LEVEL, Attitude, Pose

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
    """One view with the object of each pixel."""

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
    """Depth and face indices of one view, (H, W)."""

    depth_m: npt.NDArray[np.float32]
    """Metres along the optical axis; infinite without a surface."""
    face: npt.NDArray[np.int32]
    """Index of the mesh's face; -1 without a surface."""


def eye_of(camera: Camera, pose: Pose, attitude: Attitude = LEVEL) -> Eye:
    """Return the camera pose of a robot whose base is at `pose`, with an attitude."""
    if attitude != LEVEL:
        return _eye_on(camera, pose, attitude)
    mount = pose.compose(Pose(camera.mount_forward_m, camera.mount_left_m, math.radians(camera.yaw_deg)))
    tilt_rad, roll_rad = math.radians(camera.tilt_deg), math.radians(camera.roll_deg)
    return Eye(mount.x_m, mount.y_m, camera.mount_height_m, mount.heading_rad, tilt_rad, roll_rad)


def _eye_on(camera: Camera, pose: Pose, attitude: Attitude) -> Eye:
    level, (right, _, forward) = camera.on(attitude), camera.axes(attitude)
    mount = pose.compose(Pose(level.mount_forward_m, level.mount_left_m, math.atan2(forward[1], forward[0])))
    eye = Eye(mount.x_m, mount.y_m, level.mount_height_m, mount.heading_rad, math.asin(forward[2]))
    upright = camera_axes(Eye(0.0, 0.0, 0.0, eye.heading_rad - pose.heading_rad, eye.tilt_rad))
    return replace(eye, roll_rad=math.atan2(float(right @ upright[1]), float(right @ upright[0])))


class DepthDrawer:
    """Draws hundreds of depth views of one mesh per second; it has its own buffers and is not thread-safe."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._buffers: dict[tuple[int, int], tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]] = {}

    def draw(self, eye: Eye, pinhole: Pinhole) -> DepthView:
        """Draw a view from a pose; the next view of the same size overwrites its faces."""
        nearness, faces = self.find_faces(_position_of(eye), camera_axes(eye), pinhole)
        with np.errstate(divide="ignore"):
            return DepthView(np.reciprocal(nearness), faces)

    def find_faces(
        self, at: npt.NDArray[np.float64], axes: npt.NDArray[np.float64], pinhole: Pinhole
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Return inverse depth and face index of each pixel, (H, W); the next call with the same size overwrites them.

        Args:
            at: (3,) position of the camera.
            axes: (3, 3) from `camera_axes`.
            pinhole: the camera.
        """
        from vsnbench.simulator.rendering.raster import draw_faces, nearest_first

        mesh, size = self.mesh, (pinhole.height, pinhole.width)
        if size not in self._buffers:
            self._buffers[size] = (np.empty(size, np.float32), np.empty(size, np.int32))
        nearness, seen = self._buffers[size]
        nearness.fill(0.0)
        seen.fill(-1)
        draw_faces(
            at,
            axes,
            pinhole.focal_px,
            pinhole.centre_x,
            pinhole.centre_y,
            mesh.corners,
            mesh.normals,
            mesh.centres,
            mesh.radii,
            mesh.faces,
            nearest_first(at, mesh.centres, mesh.radii),
            nearness,
            seen,
        )
        return nearness, seen


class Renderer:
    """Draws one scene from any pose. Light and textures are computed once; it has its own buffers and is not
    thread-safe.

    The same scene and view give the same pixels in every run.
    """

    def __init__(self, scene: Scene) -> None:
        self._scan = _scan_of(scene)
        if self._scan is not None:
            return
        self._mesh, self._light = _prepared(scene)
        self._atlas, self._levels = texture_atlas()
        self._tones = _tone_table()
        self._grain = _grain_table()
        self._surface = _surface(self._mesh, self._light)
        self._drawer = DepthDrawer(self._mesh)

    def render(self, camera: Camera, pose: Pose, attitude: Attitude = LEVEL) -> Frame:
        """Draw the view of a robot's camera; `pose` is that of the base in the site's frame."""
        return self.render_from(eye_of(camera, pose, attitude), camera.width, camera.height, camera.focal_px)

    def render_from(self, eye: Eye, width: int, height: int, focal_px: float) -> Frame:
        """Draw the view of a pinhole camera at any pose."""
        from vsnbench.simulator.rendering.shading import label_pixels

        pinhole, instance = _centred(width, height, focal_px), np.empty((height, width), np.int32)
        if self._scan is not None:
            scanned = self._scan_look(self._scan, eye, pinhole)
            self._scan.label(_view(eye, pinhole), scanned.depth_m, instance)
            return Frame(scanned.rgb, scanned.depth_m, instance)
        (look, seen), mesh = self._look(eye, pinhole), self._mesh
        label_pixels(seen, mesh.owner, mesh.instances, instance)
        return Frame(look.rgb, look.depth_m, instance)

    def look(self, camera: Camera, pose: Pose, attitude: Attitude = LEVEL) -> Look:
        """Draw the view of a robot's camera without the simulator's labels."""
        eye, pinhole = eye_of(camera, pose, attitude), _centred(camera.width, camera.height, camera.focal_px)
        if self._scan is not None:
            return self._scan_look(self._scan, eye, pinhole)
        return self._look(eye, pinhole)[0]

    def measure(self, camera: Camera, pose: Pose, attitude: Attitude = LEVEL) -> npt.NDArray[np.float32]:
        """Return only the depth of `look`, (H, W) metres, without shading."""
        eye, pinhole = eye_of(camera, pose, attitude), _centred(camera.width, camera.height, camera.focal_px)
        if self._scan is not None:
            return self._scan.measure(_view(eye, pinhole), (pinhole.height, pinhole.width))
        return self._drawer.draw(eye, pinhole).depth_m

    @staticmethod
    def _scan_look(scan: ScanDrawer, eye: Eye, pinhole: Pinhole) -> Look:
        size = (pinhole.height, pinhole.width)
        look = Look(np.empty((*size, 3), np.uint8), np.empty(size, np.float32))
        scan.look(_view(eye, pinhole), look.rgb, look.depth_m)
        return look

    def _look(self, eye: Eye, pinhole: Pinhole) -> tuple[Look, npt.NDArray[np.int32]]:
        """Return a view and the face index of each pixel."""
        from vsnbench.simulator.rendering.shading import shade_pixels, soften

        at, axes, size = _position_of(eye), camera_axes(eye), (pinhole.height, pinhole.width)
        nearness, seen = self._drawer.find_faces(at, axes, pinhole)
        look = Look(np.empty((*size, 3), np.uint8), np.empty(size, np.float32))
        shade_pixels(
            at,
            axes,
            pinhole.focal_px,
            pinhole.centre_x,
            pinhole.centre_y,
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
        return look, seen


def _scan_of(scene: Scene) -> ScanDrawer | None:
    """Return the drawer of the scene's scan, or None without a scan."""
    if scene.scan is None:
        return None
    if scene.scan.path is None:
        raise SiteError("the scan of the site is not there", advice="use the site file next to the scan's file")
    drawer = ScanDrawer(load_scan(scene.scan.path, scene.scan.sha256))
    drawer.survey(scene.objects)
    return drawer


def _view(eye: Eye, pinhole: Pinhole) -> View:
    return _position_of(eye), camera_axes(eye), pinhole.focal_px, pinhole.centre_x, pinhole.centre_y


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


def _centred(width: int, height: int, focal_px: float) -> Pinhole:
    return Pinhole(width, height, focal_px, (width - 1) / 2, (height - 1) / 2)


def _position_of(eye: Eye) -> npt.NDArray[np.float64]:
    return np.array([eye.x_m, eye.y_m, eye.z_m])


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
