"""Generation of a site from a seed: draw, furnish, check, and repeat until all site checks pass."""

import math
from collections.abc import Sequence
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import numpy as np
import shapely
from numpy.random import Generator
from shapely.geometry.base import BaseGeometry

from vsnbench.errors import SiteError
from vsnbench.protocol.free_space import BoolGrid, FloatGrid
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.simulator.generated_sites import palette
from vsnbench.simulator.generated_sites.furnishing import furnish_rooms
from vsnbench.simulator.generated_sites.layout import PlannedRoom, RoomKind, draw_layout
from vsnbench.simulator.generated_sites.placing import Placer
from vsnbench.simulator.generated_sites.shell import build_shell
from vsnbench.site_checks.check import check_site
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.geometry.walls import solid_shapes
from vsnbench.sites.site import Room, Site, StartingPosition

ROBOT_RADIUS_M = 0.177
"""Radius of the Turtlebot 2, for which every generated site is passable."""
_SPARE_M = 0.07
"""Minimum clearance of passages on both sides of the robot."""
_GRID_M = 0.1
_OFF_DOORWAY_M = 0.3
"""Minimum distance of a start from a doorway."""
_START_CLEARANCE_M = 0.26
_SMALLEST_M2, _LARGEST_M2 = 50.0, 100.0
_ATTEMPTS = 200
_FLOORS = {  # rooms with a tiled floor have tiled walls too
    RoomKind.BATHROOM: ("tiles",),
    RoomKind.KITCHEN: ("tiles", "tiles", "wood", "concrete"),
    RoomKind.BEDROOM: ("wood", "carpet", "wood"),
    RoomKind.SECOND_BEDROOM: ("carpet", "wood"),
}


class Split(StrEnum):
    """Use of a generated site."""

    TRAINING = "training"
    VALIDATION = "validation"
    TEST = "test"


SEEDS: Final = MappingProxyType(
    {
        Split.TEST: range(1_000),
        Split.VALIDATION: range(1_000, 2_000),
        Split.TRAINING: range(10_000, 1_000_000),
    }
)
"""Seeds for training, validation and test; other seeds are in no split."""


class _Grid:
    """Points of the floor plan, much coarser than in the final check; all arrays are (rows, columns)."""

    def __init__(self, site: Site) -> None:
        rooms = shapely.union_all([room.shape for room in site.rooms])
        x0, y0, x1, y1 = rooms.bounds
        self.x_m, self.y_m = np.meshgrid(np.arange(x0, x1, _GRID_M), np.arange(y0, y1, _GRID_M))
        inside = shapely.contains_xy(rooms, self.x_m, self.y_m)
        self.clearance_m: FloatGrid = np.where(inside, self.distance_m(solid_shapes(site)), 0.0)
        """Distance to the nearest solid; 0 outside every room."""

    def distance_m(self, shapes: Sequence[BaseGeometry]) -> FloatGrid:
        """Return (rows, columns) distances to the nearest of the shapes."""
        points = shapely.points(self.x_m.ravel(), self.y_m.ravel())
        _, distances = shapely.STRtree(shapes).query_nearest(points, return_distance=True, all_matches=False)
        return np.asarray(distances, np.float64).reshape(self.x_m.shape)


def generate_site(seed: int) -> Site:
    """Return the site of a seed: deterministic, with every goal category and without findings of `sites check`.

    Raises:
        SiteError: no draw of this seed passed the checks (`no-generated-site`).
    """
    for attempt in range(_ATTEMPTS):
        site = _draw(seed, np.random.default_rng([seed, attempt]))
        if site is not None and not check_site(site, ROBOT_RADIUS_M):
            return site
    raise SiteError(
        f"seed {seed} gave no valid site in {_ATTEMPTS} attempts", advice="use another seed", code="no-generated-site"
    )


def _draw(seed: int, rng: Generator) -> Site | None:
    """Return one draw; None if a room, a required piece or a passage is missing."""
    rooms = draw_layout(rng)
    if not _SMALLEST_M2 <= sum(room.shape.area for room in rooms) <= _LARGEST_M2:
        return None
    shell = build_shell(rooms, rng)
    if shell is None:
        return None
    placer = Placer(rooms, shell, rng)
    if not furnish_rooms(placer):
        return None
    site = Site(
        name=f"flat-{seed}",
        title=f"Generated flat, seed {seed}",
        ceiling_height_m=round(float(rng.uniform(2.4, 2.7)), 2),
        rooms=[_room(room, rng) for room in rooms],
        walls=list(shell.walls),
        doors=list(shell.doors),
        windows=list(shell.windows),
        objects=placer.objects,
        starts=[StartingPosition(number=1, position=(0.0, 0.0), heading_deg=0.0)],
    )
    starts = _starts(site, rooms, rng)
    return None if starts is None else site.model_copy(update={"starts": starts})


def _room(room: PlannedRoom, rng: Generator) -> Room:
    floor = str(rng.choice(_FLOORS.get(room.kind, ("wood", "wood", "concrete", "carpet"))))
    outline = [(float(x), float(y)) for x, y in room.shape.exterior.coords[:-1]]
    return Room.model_validate(
        {"name": room.kind.value, "polygon": outline, "floor": floor, "floor_color": palette.floor(rng, floor)}
    )


def _starts(site: Site, rooms: tuple[PlannedRoom, ...], rng: Generator) -> list[StartingPosition] | None:
    """Return 15 to 18 poses in all rooms, far from each other and out of reach of all goals; None if impossible."""
    grid = _Grid(site)
    region = _largest_region(grid.clearance_m >= ROBOT_RADIUS_M + _SPARE_M)
    if region is None or region.sum() < 0.8 * (grid.clearance_m >= ROBOT_RADIUS_M).sum():
        return None
    nearest_m = np.full(region.shape, np.inf)
    for goal in GOAL_CATEGORIES:
        distance_m = grid.distance_m([thing.shape for thing in site.instances(goal)])
        if not (region & (distance_m < 0.75)).any():
            return None
        nearest_m = np.minimum(nearest_m, distance_m)
    success_m = ProtocolParameters().success_distance_m
    allowed = region & (grid.clearance_m >= _START_CLEARANCE_M) & (nearest_m > success_m + 0.02)
    chosen: list[tuple[float, float]] = []
    owners = [shapely.contains_xy(room.shape.buffer(-_OFF_DOORWAY_M), grid.x_m, grid.y_m) & allowed for room in rooms]
    allowed = np.logical_or.reduce(owners)
    if not all(own.any() for own in owners):
        return None
    for own in owners:
        chosen.append(_farthest(grid, own, chosen, rng))
    for _ in range(int(rng.integers(15, 19)) - len(rooms)):
        chosen.append(_farthest(grid, allowed, chosen, rng))
    order = rng.permutation(len(chosen))
    return [
        StartingPosition(
            number=number,
            position=chosen[k],
            heading_deg=float(rng.integers(-179, 181)),
            note=next(room.kind.value for room in rooms if room.shape.covers(shapely.Point(chosen[k]))),
        )
        for number, k in enumerate(order, start=1)
    ]


def _farthest(grid: _Grid, allowed: BoolGrid, chosen: list[tuple[float, float]], rng: Generator) -> tuple[float, float]:
    """Return a free position far from the chosen ones: the farthest of a few random ones."""
    rows, columns = np.nonzero(allowed)
    drawn = rng.integers(len(rows), size=12)
    places = [(float(grid.x_m[rows[k], columns[k]]), float(grid.y_m[rows[k], columns[k]])) for k in drawn]
    best = max(places, key=lambda place: min((math.dist(place, other) for other in chosen), default=0.0))
    return (round(best[0], 3), round(best[1], 3))


def _largest_region(cells: BoolGrid) -> BoolGrid | None:
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels == largest, np.bool_)
