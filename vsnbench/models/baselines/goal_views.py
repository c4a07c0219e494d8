"""Poses from which a goal is visible and near enough for STOP: where the oracle drives to."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.models.baselines.lattice_planner import LatticePlanner
from vsnbench.protocol.free_space import BoolGrid, FreeSpace
from vsnbench.sites.geometry.line_of_sight import sight
from vsnbench.sites.geometry.walls import top_m, wall_shapes
from vsnbench.sites.site import Site, SiteObject
from vsnbench.sites.targets import Target, targets_of

_REGION_MARGINS_M = (0.15, 0.08, 0.04)
"""Distances from the edge of a region at which the oracle prefers to stop; its position and the plan are not exact."""


@dataclass(frozen=True, slots=True)
class ViewCriteria:
    """Conditions for a place to stop."""

    within_m: float
    """Maximum distance to the footprint of an instance."""
    eye_height_m: float
    in_sight: bool = True
    """Whether nothing may be between the camera and the footprint."""
    walls_hide: bool = True
    """Whether walls may not be between them although furniture may: the protocol measures distance in sight."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewPoints:
    """Grid cells from which a target of a goal is near and in sight, with its direction."""

    rows: npt.NDArray[np.intp]
    columns: npt.NDArray[np.intp]
    bearing_rad: npt.NDArray[np.float64]
    """Direction to the centre of the target's footprint in the site's frame, by cell; NaN where any heading serves."""


def view_points(space: FreeSpace, goal: str, criteria: ViewCriteria) -> ViewPoints:
    """Return the cells from which targets of `goal` meet the criteria."""
    found = [target_view_points(space, target, criteria) for target in targets_of(space.site, goal)]
    if not found:
        return ViewPoints(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    return ViewPoints(
        np.concatenate([view.rows for view in found]),
        np.concatenate([view.columns for view in found]),
        np.concatenate([view.bearing_rad for view in found]),
    )


def target_view_points(space: FreeSpace, target: Target, criteria: ViewCriteria) -> ViewPoints:
    """Return the cells from which a target meets the criteria; inside a region, away from its edge if it can be."""
    if target.is_region:
        return _inside(space, target)
    window = space.window_around(target.shape, criteria.within_m)
    near = shapely.distance(target.shape, space.points(window)) < criteria.within_m
    rows, columns = np.nonzero(space.cells[window] & near)
    rows, columns = rows + window[0].start, columns + window[1].start
    if criteria.in_sight and rows.size:
        lines = shapely.shortest_line(space.points((rows, columns)), target.shape)
        occluders = _occluders(space.site, target, criteria.eye_height_m)
        shapely.prepare(occluders)
        hidden = shapely.intersects(occluders, lines)
        rows, columns = rows[~hidden], columns[~hidden]
    elif criteria.walls_hide and rows.size:
        region = sight(space.site).region(target.shape, criteria.within_m)
        seen = shapely.contains_xy(region, space.x_m[rows, columns], space.y_m[rows, columns])
        rows, columns = rows[seen], columns[seen]
    middle = target.shape.centroid
    bearing = np.arctan2(middle.y - space.y_m[rows, columns], middle.x - space.x_m[rows, columns])
    return ViewPoints(rows, columns, bearing)


def _inside(space: FreeSpace, region: Target) -> ViewPoints:
    for margin_m in (*_REGION_MARGINS_M, 0.0):
        shape = region.shape.buffer(-margin_m)
        rows, columns = np.nonzero(space.cells & shapely.contains_xy(shape, space.x_m, space.y_m))
        if rows.size:
            break
    return ViewPoints(rows, columns, np.full(rows.size, np.nan))


def target_poses(space: FreeSpace, planner: LatticePlanner, points: ViewPoints, half_view_rad: float) -> BoolGrid:
    """Return (headings, rows, columns): whether a pose has the goal within `half_view_rad` of the image centre."""
    targets = np.zeros((planner.headings, *space.cells.shape), np.bool_)
    for k in range(planner.headings):
        off = np.abs(np.angle(np.exp(1j * (points.bearing_rad - planner.heading_rad(k)))))
        seen = ~(off > half_view_rad)  # NaN: any heading
        targets[k, points.rows[seen], points.columns[seen]] = True
    return targets


def _occluders(site: Site, target: Target, eye_height_m: float) -> shapely.Geometry:
    """Return the footprints of walls and objects that can be between the camera and the centre of a target."""
    thing = target.thing
    middle_m = eye_height_m if thing is None else thing.elevation_m + thing.size_m[2] / 2
    low, high = sorted((eye_height_m, middle_m))
    tall = [
        other.shape
        for other in site.objects
        if other.id != target.id
        and other.solid
        and other.elevation_m < high
        and top_m(other) > low
        and not (thing is not None and _supports(other, thing))
    ]
    return shapely.union_all([*wall_shapes(site), *tall])


def _supports(other: SiteObject, instance: SiteObject) -> bool:
    """Return whether the instance is on top of another object, such as a monitor on a desk."""
    return math.isclose(top_m(other), instance.elevation_m, abs_tol=0.05) and other.shape.intersects(instance.shape)
