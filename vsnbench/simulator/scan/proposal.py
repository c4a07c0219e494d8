"""Proposes a site for a scan: walls with doorways, a room, what stands on the floor, and a first starting position."""

import itertools
import math
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon, box

from vsnbench.errors import SiteError
from vsnbench.protocol.free_space import free_space
from vsnbench.simulator.rendering.scan.mesh import Bytes, ScanMesh
from vsnbench.simulator.scan.occupancy import (
    BAND_M,
    CELL_M,
    OUTLINE_M,
    Floats,
    facing_points_on,
    occupied_points,
)
from vsnbench.simulator.scan.walls import SINGLE_M, wall_lines
from vsnbench.site_checks.map_walls.corners import WallLine
from vsnbench.sites.scan import SiteScan
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall

OBSTACLE: Final = "obstacle"
"""Category of what stands on the floor, until a person names it."""
_NEAR_WALL_M: Final = 0.06
_SMALLEST_M2: Final = 0.006
_MOST_OBJECTS: Final = 400
_CUT_M: Final = 1.9
PLAN_M: Final = 0.02
"""Side of a pixel of the top-down picture."""


def propose_site(mesh: ScanMesh, name: str, scan: SiteScan) -> Site:
    """Return a site for an aligned scan.

    Raises:
        SiteError: the scan has no walls (`scan-no-walls`), or no free place for a robot (`scan-no-room`).
    """
    samples, facing = facing_points_on(mesh)
    walls = wall_lines(samples, facing)
    if not walls:
        raise SiteError(
            "the scan has no walls", advice="scan the walls up to a height of 2 m as well", code="scan-no-walls"
        )
    room = _outline(walls)
    walls = [_without_ways_out(wall, room) for wall in _without_repetitions([*walls, *_closing(walls, room)])]
    things = _things(samples, walls, room)
    doors = [
        Door(name=f"door-{number}", start=_point(start), end=_point(end))
        for number, (start, end) in enumerate((gap for wall in walls for gap in wall.doorways), start=1)
    ]
    values = {
        "name": name,
        "ceiling_height_m": _ceiling(samples),
        "survey_error_m": 0.03,
        "rooms": [Room(name="flat", polygon=[_point(corner) for corner in room.exterior.coords[:-1]])],
        "walls": [Wall(start=_point(wall.start), end=_point(wall.end), thickness_m=_thickness(wall)) for wall in walls],
        "doors": doors,
        "objects": things,
        "scan": scan,
    }
    draft = Site(**values, starts=[StartingPosition(number=1, position=_point(room.centroid.coords[0]), heading_deg=0)])
    space = free_space(draft.model_copy(update={"scan": None}), 0.18)
    if not space.cells.any():
        raise SiteError(
            "the scan has no free floor for a robot",
            advice="look at the top-down picture: is the scale right?",
            code="scan-no-room",
        )
    row, column = np.unravel_index(int(np.argmax(space.clearance_m)), space.clearance_m.shape)
    at = (round(float(space.x_m[row, column]), 2), round(float(space.y_m[row, column]), 2))
    return Site(**values, starts=[StartingPosition(number=1, position=at, heading_deg=0.0, note="proposed")])


def _thickness(wall: WallLine) -> float:
    return min(max(round(wall.thickness_m, 2), 0.02), 0.9)


def _point(values: tuple[float, ...]) -> tuple[float, float]:
    return (round(float(values[0]), 3), round(float(values[1]), 3))


def _ceiling(samples: Floats) -> float:
    """Return the height of the ceiling: where most high points are, else 2.5 m."""
    high = samples[samples[:, 2] > 1.9, 2]
    if len(high) < 100:
        return 2.5
    bins = np.bincount((high / 0.02).astype(int))
    return round(min(max((int(np.argmax(bins)) + 0.5) * 0.02, 1.6), 9.9), 2)


def _outline(walls: list[WallLine]) -> Polygon:
    """Return the outline of the floor plan along the centre lines of walls: what they enclose, with gaps closed."""
    footprints = shapely.union_all([_shape(replace(wall, thickness_m=SINGLE_M)) for wall in walls])
    closed = footprints.buffer(0.45, join_style="mitre").buffer(-0.45, join_style="mitre")
    parts = [Polygon(part.exterior) for part in _polygons(closed)]
    whole = shapely.union_all(parts)
    outline = max(_polygons(whole), key=lambda part: part.area)
    if outline.area < 0.5 * footprints.envelope.area:  # open on a side
        outline = box(*footprints.bounds)
    return Polygon(shapely.simplify(outline, 0.03).exterior)


def _closing(walls: list[WallLine], room: Polygon) -> list[WallLine]:
    """Return walls along the parts of the outline where the scan has none, such as windows."""
    missing = room.exterior.difference(shapely.union_all([_shape(wall) for wall in walls]).buffer(0.06))
    lines = [line for line in shapely.get_parts(shapely.line_merge(missing)) if isinstance(line, shapely.LineString)]
    corners = [shapely.simplify(line, 0.03).coords for line in lines]
    return [
        WallLine(_point(start), _point(end), SINGLE_M)
        for line in corners
        for start, end in itertools.pairwise(line)
        if math.dist(start, end) > 0.05
    ]


def _without_repetitions(walls: list[WallLine]) -> list[WallLine]:
    """Return the walls that are not mostly inside a longer one."""
    kept: list[WallLine] = []
    for wall in sorted(walls, key=lambda wall: -wall.length_m):
        shape = _shape(wall)
        if all(shape.intersection(_shape(other).buffer(0.03)).area < 0.7 * shape.area for other in kept):
            kept.append(wall)
    return kept


def _without_ways_out(wall: WallLine, room: Polygon) -> WallLine:
    """Return a wall without the doorways that lead out of the outline: there the wall was hidden."""
    inwards = room.buffer(-0.25)
    return replace(
        wall, doorways=tuple(gap for gap in wall.doorways if inwards.contains(shapely.LineString(gap).centroid))
    )


def _polygons(shape: shapely.Geometry) -> list[Polygon]:
    parts = shape.geoms if isinstance(shape, MultiPolygon) else [shape]
    return [part for part in parts if isinstance(part, Polygon) and not part.is_empty]


def _shape(wall: WallLine) -> Polygon:
    return shapely.LineString([wall.start, wall.end]).buffer(wall.thickness_m / 2, cap_style="square")


def _things(samples: Floats, walls: list[WallLine], room: Polygon) -> list[SiteObject]:
    """Return what stands in the way of a robot, as outlines with a height."""
    near_walls = shapely.union_all(
        [
            _shape(wall)
            .buffer(_NEAR_WALL_M, join_style="mitre")
            .difference(
                shapely.union_all(
                    [
                        shapely.LineString(gap).buffer(wall.thickness_m / 2 + 0.1, cap_style="flat")
                        for gap in wall.doorways
                    ]
                )
            )
            for wall in walls
        ]
    )
    cells = occupied_points(samples, *BAND_M)
    if not len(cells):
        return []
    half = CELL_M / 2
    squares = shapely.box(cells[:, 0] - half, cells[:, 1] - half, cells[:, 0] + half, cells[:, 1] + half)
    merged = shapely.union_all(squares).buffer(OUTLINE_M, join_style="mitre").buffer(-OUTLINE_M, join_style="mitre")
    standing = merged.difference(near_walls).intersection(room)
    blobs = [
        part
        for part in _polygons(standing)
        if part.area > _SMALLEST_M2 and not (part.buffer(-CELL_M).is_empty and part.distance(near_walls) < CELL_M)
    ]
    blobs.sort(key=lambda part: -part.area)
    below, things = samples[samples[:, 2] < _CUT_M], []
    for number, blob in enumerate(blobs[:_MOST_OBJECTS], start=1):
        simple = shapely.simplify(Polygon(blob.exterior), 0.015)
        outline = Polygon([_point(corner) for corner in simple.exterior.coords])  # rounded, corners can meet
        if not outline.is_valid or outline.area < _SMALLEST_M2 / 2:
            outline = box(*blob.bounds)
        x0, y0, x1, y1 = outline.bounds
        shapely.prepare(outline)
        low = below[(below[:, 0] > x0) & (below[:, 0] < x1) & (below[:, 1] > y0) & (below[:, 1] < y1)]
        heights = low[shapely.contains_xy(outline, low[:, 0], low[:, 1]), 2]
        top = float(np.percentile(heights, 98)) if len(heights) else BAND_M[1]
        things.append(
            SiteObject(
                id=f"{OBSTACLE}-{number}",
                category=OBSTACLE,
                position=_point(((x0 + x1) / 2, (y0 + y1) / 2)),
                size_m=(round(max(x1 - x0, 0.02), 3), round(max(y1 - y0, 0.02), 3), round(max(top, 0.05), 2)),
                footprint=[_point(corner) for corner in outline.exterior.coords[:-1]],
            )
        )
    return things


def top_down(mesh: ScanMesh) -> tuple[Bytes, tuple[float, float]]:
    """Return a picture of the scan from above, cut at a height of 1.9 m, and its lower left corner.

    A pixel is `PLAN_M` wide; the camera is so high that walls show no sides.
    """
    from vsnbench.simulator.rendering.scan.drawing import ScanDrawer

    low = np.array([mesh.vertices[:, 0].min(), mesh.vertices[:, 1].min()]) - 0.2
    size = np.ceil((np.array([mesh.vertices[:, 0].max(), mesh.vertices[:, 1].max()]) + 0.2 - low) / PLAN_M).astype(int)
    size = np.minimum(size, 6000)
    below = (mesh.vertices[mesh.faces][..., 2] < _CUT_M).all(axis=1)
    kept = below if below.any() else np.ones(len(mesh.faces), np.bool_)
    parts = (mesh.faces[kept], mesh.colors, mesh.texture[kept], mesh.uv[kept], mesh.textures)
    low_splats = None if mesh.splats is None else mesh.splats.chosen(mesh.splats.centres[:, 2] < _CUT_M)
    cut = ScanMesh(mesh.vertices, *parts, None if low_splats is None or not len(low_splats.centres) else low_splats)
    height_m = 2000.0
    middle = low + size * PLAN_M / 2
    axes = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    view = (np.array([*middle, height_m]), axes, height_m / PLAN_M, (size[0] - 1) / 2, (size[1] - 1) / 2)
    rgb, depth = np.zeros((size[1], size[0], 3), np.uint8), np.zeros((size[1], size[0]), np.float32)
    ScanDrawer(cut).look(view, rgb, depth)
    rgb[np.isnan(depth)] = 255
    return rgb, (float(low[0]), float(low[1]))
