"""Paints a site as a floor plan, with the goal's instances highlighted."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsnbench.sites.geometry.walls import lowest_first, wall_area
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of

if TYPE_CHECKING:
    from shapely.geometry import Polygon

PLAN_PIXEL_M = 0.0125
ROOM_RGB = {"wood": (244, 236, 222), "tiles": (226, 234, 238), "carpet": (238, 230, 236), "concrete": (232, 232, 230)}
WALL_RGB = (70, 72, 78)
DOOR_RGB = (170, 130, 90)
WINDOW_RGB = (120, 170, 210)
FURNITURE_RGB = (206, 204, 198)
FURNITURE_EDGE_RGB = (150, 148, 142)
GOAL_RGB = (88, 172, 108)
GOAL_EDGE_RGB = (22, 110, 52)


def paint_site(site: Site, goal: str) -> tuple[npt.NDArray[np.uint8], tuple[float, float]]:
    """Paint rooms, walls and furniture.

    Returns:
        An RGB image, (H, W, 3) uint8, and the position of its lower left corner in metres.
    """
    import cv2
    from shapely import union_all

    area = union_all([wall_area(site), *(room.shape for room in site.rooms)])
    left, bottom, right, top = area.buffer(0.05).bounds
    width, height = math.ceil((right - left) / PLAN_PIXEL_M), math.ceil((top - bottom) / PLAN_PIXEL_M)
    corner = (left, top - height * PLAN_PIXEL_M)
    picture = np.full((height, width, 3), 250, np.uint8)

    def pixels(points: Iterable[tuple[float, float]]) -> npt.NDArray[np.int32]:
        scaled = [
            ((x - corner[0]) / PLAN_PIXEL_M * 16, (height - (y - corner[1]) / PLAN_PIXEL_M) * 16) for x, y in points
        ]
        return np.array(scaled).round().astype(np.int32)

    def fill(points: Iterable[tuple[float, float]], rgb: tuple[int, int, int]) -> None:
        cv2.fillPoly(picture, [pixels(points)], rgb, lineType=cv2.LINE_AA, shift=4)

    def trace(points: Iterable[tuple[float, float]], rgb: tuple[int, int, int], closed: bool, thick_m: float) -> None:
        thickness = max(1, round(thick_m / PLAN_PIXEL_M))
        cv2.polylines(picture, [pixels(points)], closed, rgb, thickness, lineType=cv2.LINE_AA, shift=4)

    for room in site.rooms:
        fill(room.polygon, ROOM_RGB[room.floor])
    searched = {target.id for target in targets_of(site, goal)}
    for item in lowest_first(site):
        is_goal = item.id in searched
        edge = outline(item.shape)
        fill(edge, GOAL_RGB if is_goal else FURNITURE_RGB if item.solid else (228, 220, 212))
        trace(edge, GOAL_EDGE_RGB if is_goal else FURNITURE_EDGE_RGB, True, 0.02)
    for wall in site.walls:
        fill(outline(wall.shape), WALL_RGB)
    for window in site.windows:
        trace([window.start, window.end], WINDOW_RGB, False, 0.08)
    for door in site.doors:
        color = DOOR_RGB if door.closed else ROOM_RGB["wood"]
        trace([door.start, door.end], color, False, 0.12)
    return picture, corner


def outline(shape: "Polygon") -> list[tuple[float, float]]:
    """Return the corners of a polygon, metres."""
    return [(float(x), float(y)) for x, y in shape.exterior.coords]
