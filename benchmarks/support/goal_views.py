"""Views of a site from free robot poses, each with one goal object, whole or cut, or with none."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import shapely

from benchmarks.support.coco_network import Box
from vsnbench.protocol.free_space import FreeSpace, free_space
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.rendering.mesh import build_mesh
from vsnbench.simulator.rendering.renderer import DepthDrawer, Pinhole, Renderer, eye_of
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

CLASS_OF_CATEGORY = {
    "bed": "bed",
    "chair": "chair",
    "monitor": "tv",
    "plant": "potted plant",
    "sofa": "couch",
    "table": "dining table",
    "toilet": "toilet",
}
"""Goal categories and their COCO classes."""
NEAREST_M, FARTHEST_M = 1.0, 4.5
"""Distance from the robot to the nearest point of the goal's outline."""
WHOLE_SHARE, CUT_SHARE = 0.8, 0.25
"""Least visible share of the goal's silhouette, in views of whole and of cut goals."""
SMALLEST_SHARE = 0.002
"""A goal covers at least this share of the image."""
_SMALLEST_OBJECT_PX = 30
"""Objects with fewer pixels do not count as visible."""
_HALF_SPREAD_RAD = math.radians(35)
"""Largest angle between heading and goal; half the camera's angle of view is 30°."""
_CANVAS = 3
"""Silhouettes are drawn on a canvas this many times as wide and high as the image."""
_STRIDE = 3
"""Every third row and column of the free space is enough."""
_POSES = 200
"""Poses tried for one category in one site."""


class Extent(StrEnum):
    """How much of the goal a view shows."""

    WHOLE = "whole"
    """At least `WHOLE_SHARE` of its silhouette, none of it at the edge of the image."""
    CUT = "cut"
    """Cut by the edge of the image or partly hidden, at least `CUT_SHARE` of its silhouette."""


@dataclass(frozen=True, slots=True)
class Visible:
    """A visible object and the box of its pixels."""

    category: str
    box: Box
    share: float = 1.0
    """Of the image's pixels."""
    distance_m: float = 0.0
    """Median depth."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """An image and what it shows."""

    rgb: npt.NDArray[np.uint8]
    objects: tuple[Visible, ...]
    """All visible objects, furniture included."""
    goal: Visible | None = None
    extent: Extent | None = None


class Flat:
    """A site with its renderer, and the silhouettes of its objects alone."""

    def __init__(self, site: Site) -> None:
        profile = load_profile("turtlebot2")
        self.site = site
        self.camera: Camera = profile.camera.without_roll
        self.space: FreeSpace = free_space(site, profile.base.radius_m)
        self._scene = build_scene(site)
        self._renderer = Renderer(self._scene)
        self._drawer = DepthDrawer(build_mesh(self._scene))
        self._drawers = {
            number: DepthDrawer(build_mesh(Scene(parts, self._scene.bounds, self._scene.ceiling_height_m)))
            for number, thing in enumerate(site.objects, start=1)
            if thing.category in GOAL_CATEGORIES
            and (parts := tuple(part for part in self._scene.primitives if part.instance == number))
        }

    def view(self, pose: Pose) -> View:
        """Return the view from a pose."""
        frame = self._renderer.render(self.camera, pose)
        objects = []
        for number, thing in enumerate(self.site.objects, start=1):
            mask = frame.instance == number
            if (box := _box_of(mask)) is not None:
                share = np.count_nonzero(mask) / mask.size
                objects.append(Visible(thing.category, box, share, float(np.median(frame.depth_m[mask]))))
        return View(frame.rgb, tuple(objects))

    def instances(self, pose: Pose) -> npt.NDArray[np.int32]:
        """Return the object of each pixel, 1 + its index, without shading the image."""
        mesh, seen = self._drawer.mesh, self._faces_seen(self._drawer, pose, 1)
        numbers = mesh.instances[mesh.owner[seen]]
        return np.where(seen >= 0, numbers, 0).astype(np.int32)

    def silhouette_px(self, number: int, pose: Pose) -> int:
        """Return the pixels of an object that nothing hides and no edge cuts."""
        return int(np.count_nonzero(self._faces_seen(self._drawers[number], pose, _CANVAS) >= 0))

    def _faces_seen(self, drawer: DepthDrawer, pose: Pose, scale: int) -> npt.NDArray[np.int32]:
        """Return the face of each pixel of a canvas `scale` times as wide and high as the image; -1 for none."""
        width, height = scale * self.camera.width, scale * self.camera.height
        pinhole = Pinhole(width, height, self.camera.focal_px, (width - 1) / 2, (height - 1) / 2)
        return drawer.draw(eye_of(self.camera, pose), pinhole).face


def goal_views(flat: Flat, category: str, count: int, random: np.random.Generator) -> Iterator[View]:
    """Yield up to `count` views with the goal whole and `count` with it cut."""
    numbers = [number for number, thing in enumerate(flat.site.objects, start=1) if thing.category == category]
    wanted = dict.fromkeys(Extent, count)
    places = {number: _places_near(flat, number) for number in numbers}
    numbers = [number for number in numbers if len(places[number])]
    if not numbers:
        return
    for _ in range(_POSES * count):
        number = int(random.choice(numbers))
        x_m, y_m = random.choice(places[number])
        goal_x_m, goal_y_m = flat.site.objects[number - 1].position
        towards_rad = math.atan2(goal_y_m - y_m, goal_x_m - x_m)
        pose = Pose(float(x_m), float(y_m), towards_rad + float(random.uniform(-1, 1)) * _HALF_SPREAD_RAD)
        mask = flat.instances(pose) == number
        extent = _extent_of(flat, number, pose, mask)
        box = _box_of(mask)
        if extent is None or box is None or not wanted[extent]:
            continue
        wanted[extent] -= 1
        yield replace(flat.view(pose), goal=Visible(category, box), extent=extent)
        if not any(wanted.values()):
            return


def views_without_goal(flat: Flat, count: int, random: np.random.Generator) -> Iterator[View]:
    """Yield up to `count` views from random free poses in which no goal category is visible."""
    free = np.argwhere(flat.space.cells)
    goals = [number for number, thing in enumerate(flat.site.objects, start=1) if thing.category in GOAL_CATEGORIES]
    for _ in range(_POSES * count):
        row, column = random.choice(free)
        heading_rad = float(random.uniform(-math.pi, math.pi))
        pose = Pose(float(flat.space.x_m[row, column]), float(flat.space.y_m[row, column]), heading_rad)
        if not np.isin(flat.instances(pose), goals).any():
            yield flat.view(pose)
            count -= 1
        if not count:
            return


def _places_near(flat: Flat, number: int) -> npt.NDArray[np.float64]:
    """Return the free positions (N, 2) in range of an object."""
    shape = flat.site.objects[number - 1].shape
    sparse = (slice(None, None, _STRIDE), slice(None, None, _STRIDE))
    free = flat.space.cells[sparse]
    places = np.stack([flat.space.x_m[sparse][free], flat.space.y_m[sparse][free]], axis=1)
    distance_m = shapely.distance(shapely.points(places), shape)
    return places[(distance_m >= NEAREST_M) & (distance_m <= FARTHEST_M)]


def _extent_of(flat: Flat, number: int, pose: Pose, mask: npt.NDArray[np.bool_]) -> Extent | None:
    """Return how much of a goal with the pixels of a mask a view shows; None if too little."""
    visible_px = int(np.count_nonzero(mask))
    if visible_px < SMALLEST_SHARE * mask.size:
        return None
    share = visible_px / max(flat.silhouette_px(number, pose), 1)
    at_edge = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
    if share >= WHOLE_SHARE and not at_edge:
        return Extent.WHOLE
    return Extent.CUT if share >= CUT_SHARE else None


def _box_of(mask: npt.NDArray[np.bool_]) -> Box | None:
    """Return the box around an object's pixels; None if it has too few."""
    if np.count_nonzero(mask) < _SMALLEST_OBJECT_PX:
        return None
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1))
