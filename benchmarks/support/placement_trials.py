"""Random trials for placement: rooms unlike their survey, displaced robots, imperfect cameras."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from shapely import Point

from vsnbench.localization.looks import DepthLook
from vsnbench.simulator.dynamics.noise import DepthNoise, noisy_depth
from vsnbench.simulator.rendering.mesh import build_mesh
from vsnbench.simulator.rendering.renderer import DepthDrawer, Pinhole, eye_of
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.geometry.walls import walls_of
from vsnbench.sites.site import Door, Site, SiteObject, StartingPosition, Window
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

SURVEY_M = 0.02
"""Standard deviation of an object's surveyed position in metres, along x and along y."""
DEPTH_SCALE = 0.01
"""Error of the camera's depth scale, in either direction."""
Opening = TypeVar("Opening", Door, Window)
_NEAR_M, _CLEARANCE_M = 4.0, 0.18
_MOVED_M = (0.3, 1.0)


@dataclass(frozen=True, slots=True)
class Trial:
    """A robot near a mark, in a room that differs from its survey."""

    site: Site
    """Site as surveyed."""
    room: Site
    """Real room."""
    start: StartingPosition
    pose: Pose
    moved: tuple[str, ...]
    depth_scale: float
    """Measured depth divided by true depth."""


def draw_trial(
    site: Site,
    start: StartingPosition,
    rng: Generator,
    most_m: float = 0.40,
    most_deg: float = 25.0,
    moved: int = 2,
    walls_m: float = 0.0,
) -> Trial:
    """Draw a room and a free pose of the robot in it.

    Args:
        site: site as surveyed.
        start: mark.
        rng: source of randomness.
        most_m: largest distance from the mark in metres; positions within it are equally likely.
        most_deg: largest heading error in degrees.
        moved: number of objects within 4 m of the mark to move by 0.3 to 1 m.
        walls_m: standard deviation in metres of each corner of the building, along x and along y.
    """
    near = [
        thing.id
        for thing in site.objects
        if thing.solid and thing.elevation_m == 0 and math.dist(thing.position, start.position) < _NEAR_M
    ]
    while True:
        chosen = tuple(sorted(str(name) for name in rng.choice(near, min(moved, len(near)), replace=False)))
        room = site.model_copy(update={"objects": [_put(thing, thing.id in chosen, rng) for thing in site.objects]})
        if walls_m:
            room = with_corners_off(room, walls_m, rng)
        way_m, bearing = most_m * math.sqrt(rng.random()), rng.uniform(0, math.tau)
        turn_rad = math.radians(rng.uniform(-most_deg, most_deg))
        pose = start.pose.compose(Pose(way_m * math.cos(bearing), way_m * math.sin(bearing), turn_rad))
        if _is_free(room, pose):
            return Trial(site, room, start, pose, chosen, 1 + DEPTH_SCALE * float(rng.choice([-1, 1])))


def _put(thing: SiteObject, elsewhere: bool, rng: Generator) -> SiteObject:
    dx, dy = rng.normal(0.0, SURVEY_M, 2)
    if elsewhere:
        way_m, bearing = rng.uniform(*_MOVED_M), rng.uniform(0, math.tau)
        dx, dy = way_m * math.cos(bearing), way_m * math.sin(bearing)
    x_m, y_m = thing.position
    outline = None if thing.footprint is None else [(x + dx, y + dy) for x, y in thing.footprint]
    return thing.model_copy(update={"position": (x_m + dx, y_m + dy), "footprint": outline})


def with_corners_off(site: Site, off_m: float, rng: Generator) -> Site:
    """Return a site with displaced building corners, like the errors of a survey by tape measure.

    Walls that share a corner still share it; their lengths and directions change slightly. Doors and windows stay in
    their walls.

    Args:
        site: site as surveyed.
        off_m: standard deviation of a corner in metres, along x and along y.
        rng: source of randomness.
    """
    steps: dict[tuple[float, float], tuple[float, float]] = {}

    def put(corner: tuple[float, float]) -> tuple[float, float]:
        dx, dy = steps.setdefault(corner, (float(rng.normal(0.0, off_m)), float(rng.normal(0.0, off_m))))
        return (corner[0] + dx, corner[1] + dy)

    walls = [wall.model_copy(update={"start": put(wall.start), "end": put(wall.end)}) for wall in site.walls]

    def within_its_wall(opening: Opening) -> Opening:
        number, was = next(
            (number, wall)
            for number, wall in enumerate(site.walls)
            if wall in walls_of(site, opening.start, opening.end)
        )
        line, length_m = walls[number].centre_line, was.length_m
        ends = [
            line.interpolate(was.centre_line.project(Point(end)) / length_m, normalized=True).coords[0]
            for end in (opening.start, opening.end)
        ]
        return opening.model_copy(update={"start": ends[0], "end": ends[1]})

    return site.model_copy(
        update={
            "walls": walls,
            "doors": [within_its_wall(door) for door in site.doors],
            "windows": [within_its_wall(window) for window in site.windows],
        }
    )


def _is_free(room: Site, pose: Pose) -> bool:
    here = Point(pose.position)
    shapes = [thing.shape for thing in room.objects if thing.solid and thing.elevation_m < 0.4]
    shapes += [wall.shape for wall in room.walls]
    return min(shape.distance(here) for shape in shapes) > _CLEARANCE_M


class NoisyEye:
    """A depth camera in a room, with noise, holes and a scale error."""

    def __init__(
        self, room: Site, camera: Camera, scale: float, rng: Generator, noise: DepthNoise | None = None
    ) -> None:
        self._drawer = DepthDrawer(build_mesh(build_scene(room)))
        self._camera = camera
        self._scale = scale
        self._rng = rng
        self._noise = noise or DepthNoise()

    def look(self, pose: Pose, odometry: Pose | None = None) -> DepthLook:
        """Return a depth look with the base at `pose`."""
        camera, mesh = self._camera, self._drawer.mesh
        pinhole = Pinhole(camera.width, camera.height, camera.focal_px, *camera.center_px)
        view = self._drawer.draw(eye_of(camera, pose), pinhole)
        owner = mesh.owner[np.maximum(view.face, 0)]
        rgb = _unlit(mesh.colors[owner])
        depth_m = noisy_depth(view.depth_m, rgb, mesh.shininess[owner].astype(np.float32), self._noise, self._rng)
        depth_m *= np.float32(self._scale)
        with np.errstate(invalid="ignore"):
            depth_m[(depth_m < camera.depth_min_m) | (depth_m > camera.depth_max_m)] = np.nan
        return DepthLook(depth_m, odometry or Pose(0.0, 0.0), camera)

    def turn(self, pose: Pose, count: int = 12, turn_error: float = 0.0) -> tuple[list[DepthLook], Pose]:
        """Turn a full circle on the spot; return the looks and the robot's final pose.

        Args:
            pose: pose at the start.
            count: number of turns in the circle.
            turn_error: true turn minus turn in the odometry, as a share of the latter.
        """
        odometry = [Pose(0.0, 0.0, math.tau * number / count) for number in range(count + 1)]
        true = [pose.compose(Pose(0.0, 0.0, measured.heading_rad * (1 + turn_error))) for measured in odometry]
        return [self.look(there, measured) for there, measured in zip(true, odometry, strict=True)], true[-1]


def _unlit(colors: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """Return linear colours as an sRGB image under uniform light."""
    srgb = np.where(colors <= 0.0031308, 12.92 * colors, 1.055 * np.maximum(colors, 1e-9) ** (1 / 2.4) - 0.055)
    return np.asarray(np.clip(255 * srgb, 0, 255), np.uint8)


def first_starts(sites: Sequence[Site], count: int = 15) -> list[tuple[Site, StartingPosition]]:
    """Return the first starting positions of each site."""
    return [(site, start) for site in sites for start in site.starts[:count]]
