"""Where a goal can be seen from, near enough to say STOP: the poses that the oracle wants to reach."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.models.lattice_planner import LatticePlanner
from vsnbench.protocol.free_space import BoolGrid, FreeSpace
from vsnbench.protocol.sight import sight
from vsnbench.protocol.site import Site, SiteObject
from vsnbench.protocol.walls import top_m, wall_shapes


@dataclass(frozen=True, slots=True)
class ViewCriteria:
    """What makes a place a good one to stop at."""

    within_m: float
    """Nearer than this to the footprint of an instance."""
    eye_height_m: float
    in_sight: bool = True
    """Nothing stands between the camera and the footprint."""
    walls_hide: bool = True
    """Where furniture may stand between them, walls may not: the protocol measures distance in sight."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewPoints:
    """Grid cells from which an instance of a goal is near and in sight, and where it then is."""

    rows: npt.NDArray[np.intp]
    columns: npt.NDArray[np.intp]
    bearing_rad: npt.NDArray[np.float64]
    """Direction of the middle of the instance's footprint, site frame; the same length as rows and columns."""


def view_points(space: FreeSpace, goal: str, criteria: ViewCriteria) -> ViewPoints:
    """Return from where instances of `goal` are as near and as visible as `criteria` asks for."""
    found = [instance_view_points(space, instance, criteria) for instance in space.site.instances(goal)]
    if not found:
        return ViewPoints(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    return ViewPoints(
        np.concatenate([each.rows for each in found]),
        np.concatenate([each.columns for each in found]),
        np.concatenate([each.bearing_rad for each in found]),
    )


def instance_view_points(space: FreeSpace, instance: SiteObject, criteria: ViewCriteria) -> ViewPoints:
    """Return from where one instance is as near and as visible as `criteria` asks for."""
    window = space.window_around(instance.shape, criteria.within_m)
    near = shapely.distance(instance.shape, space.points(window)) < criteria.within_m
    rows, columns = np.nonzero(space.cells[window] & near)
    rows, columns = rows + window[0].start, columns + window[1].start
    if criteria.in_sight and rows.size:
        lines = shapely.shortest_line(space.points((rows, columns)), instance.shape)
        screens = _screens(space.site, instance, criteria.eye_height_m)
        shapely.prepare(screens)
        hidden = shapely.intersects(screens, lines)
        rows, columns = rows[~hidden], columns[~hidden]
    elif criteria.walls_hide and rows.size:
        region = sight(space.site).region(instance.shape, criteria.within_m)
        seen = shapely.contains_xy(region, space.x_m[rows, columns], space.y_m[rows, columns])
        rows, columns = rows[seen], columns[seen]
    middle = instance.shape.centroid
    bearing = np.arctan2(middle.y - space.y_m[rows, columns], middle.x - space.x_m[rows, columns])
    return ViewPoints(rows, columns, bearing)


def wanted_poses(space: FreeSpace, planner: LatticePlanner, points: ViewPoints, half_view_rad: float) -> BoolGrid:
    """Return (headings, rows, columns): whether a pose there shows the goal within `half_view_rad` of the middle."""
    wanted = np.zeros((planner.headings, *space.cells.shape), np.bool_)
    for k in range(planner.headings):
        off = np.abs(np.angle(np.exp(1j * (points.bearing_rad - planner.heading_rad(k)))))
        seen = off <= half_view_rad
        wanted[k, points.rows[seen], points.columns[seen]] = True
    return wanted


def _screens(site: Site, instance: SiteObject, eye_height_m: float) -> shapely.Geometry:
    """Return the footprints of everything tall enough to stand between the camera and the middle of an instance."""
    middle_m = instance.elevation_m + instance.size_m[2] / 2
    low, high = sorted((eye_height_m, middle_m))
    tall = [
        thing.shape
        for thing in site.objects
        if thing.id != instance.id
        and thing.solid
        and thing.elevation_m < high
        and top_m(thing) > low
        and not _carries(thing, instance)
    ]
    return shapely.union_all([*wall_shapes(site), *tall])


def _carries(thing: SiteObject, instance: SiteObject) -> bool:
    """Whether the instance stands on top of the other thing, as a monitor does on a desk."""
    return math.isclose(top_m(thing), instance.elevation_m, abs_tol=0.05) and thing.shape.intersects(instance.shape)
