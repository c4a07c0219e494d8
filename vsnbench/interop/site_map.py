"""Converts a surveyed site to an occupancy grid, as a robot would map it."""

import math

import numpy as np
import shapely

from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, UNKNOWN, PlanGrid
from vsnbench.sites.geometry.walls import solid_shapes, wall_area, wall_shapes
from vsnbench.sites.site import Site
from vsnbench.values.pose import Pose

_MARGIN_M = 0.5
_SCANNER_HEIGHT_M = 0.4


def map_of_site(site: Site, resolution_m: float = 0.05, *, furniture: bool = True) -> PlanGrid:
    """Draw a site as an occupancy grid.

    Args:
        site: the site.
        resolution_m: side of a cell.
        furniture: include furniture, as a laser scanner would; objects that begin above 0.4 m are left out.
    """
    x_min, y_min, x_max, y_max = (float(value) for value in wall_area(site).buffer(_MARGIN_M).bounds)
    columns, rows = math.ceil((x_max - x_min) / resolution_m), math.ceil((y_max - y_min) / resolution_m)
    x_m, y_m = np.meshgrid(
        x_min + (np.arange(columns) + 0.5) * resolution_m, y_min + (np.arange(rows) + 0.5) * resolution_m
    )
    cells = np.full((rows, columns), UNKNOWN, np.uint8)
    cells[shapely.contains_xy(shapely.union_all([room.shape for room in site.rooms]), x_m, y_m)] = FREE
    solid = shapely.union_all(solid_shapes(site, _SCANNER_HEIGHT_M) if furniture else wall_shapes(site))
    shapely.prepare(solid)
    cells[shapely.contains_xy(solid, x_m, y_m)] = OCCUPIED
    shut = [door.centre_line.buffer(resolution_m) for door in site.doors if door.closed]
    if shut:
        cells[shapely.contains_xy(shapely.union_all(shut), x_m, y_m)] = OCCUPIED
    return PlanGrid(cells, resolution_m, Pose(x_min, y_min))
