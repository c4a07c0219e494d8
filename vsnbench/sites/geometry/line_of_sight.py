"""Distance in sight: along straight lines on the floor plan that no wall and no closed door crosses.

Furniture does not block sight. Windows and walls of any height do: a low barrier should be surveyed as an object.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.sites.fields import Point
from vsnbench.sites.geometry.walls import wall_shapes
from vsnbench.sites.site import Site

Floats = npt.NDArray[np.float64]

_CRACK_M = 0.02
"""Maximum width of a gap between two walls that is closed: it is rounding of the survey."""
_GRAZE_M = 1e-3
"""Maximum depth of a line in a wall that does not count as crossing it."""
_SAMPLE_M = 0.05
"""Distance between samples of a footprint's outline, for the region from which it is in sight."""
_FAR = 1e4
"""Length of a wall's shadow as a multiple of the distance to the wall."""
_ROUNDING_M = 1e-6
_CIRCLE_QUARTER = 64
"""Segments of a quarter circle in outlines: an error of 0.08 mm at 1 m."""
_EDGE_ON = 1e-12
"""Minimum cross product of a face's ends, square metres; smaller faces are seen edge-on."""
_SLIT_RAD = 1e-7
"""Maximum angle between adjacent faces: rounding, a micrometre at 10 m."""


@dataclass(frozen=True, slots=True, eq=False)
class _Faces:
    """Straight faces of walls seen from a point, from left end to right end: (N, 2) metres relative to the point."""

    here: Point
    start: Floats
    along: Floats
    first_rad: Floats
    """Direction of the right end."""
    width_rad: Floats


class Sight:
    """Lines of sight on a site's floor plan. Use `sight`, which caches instances."""

    def __init__(self, site: Site) -> None:
        """Prepare the walls of a site, with cracks between them closed."""
        solid = shapely.union_all(wall_shapes(site))
        closed = solid.buffer(_CRACK_M / 2, join_style="mitre").buffer(-_CRACK_M / 2, join_style="mitre")
        self.walls: BaseGeometry = closed.buffer(-_GRAZE_M, join_style="mitre")
        """What blocks sight, metres in the site's frame."""
        shapely.prepare(self.walls)
        parts = shapely.orient_polygons(shapely.get_parts(self.walls))  # seen from outside, edges run to the right
        corners, ring = shapely.get_coordinates(shapely.get_rings(parts), return_index=True)
        same = ring[:-1] == ring[1:]
        self._edges: Floats = np.stack([corners[:-1][same], corners[1:][same]], axis=1)
        self._edge_lines = np.asarray(shapely.linestrings(self._edges), dtype=object)
        self._regions: dict[tuple[bytes, float], BaseGeometry] = {}
        self._faces: _Faces | None = None

    def distance_m(self, here: Point, shape: BaseGeometry) -> float:
        """Return the distance from a point to the visible part of a footprint, metres.

        0 inside the footprint, infinity if nothing is visible.
        """
        point = shapely.Point(here)
        if not self.walls.intersects(shapely.shortest_line(point, shape)):
            return float(shape.distance(point))
        if self.walls.contains(point) or self._is_behind_walls(here, shape):
            return math.inf
        between = shapely.union(point, shape).convex_hull
        seen = shape.difference(self._shadows(here, between))
        return math.inf if seen.is_empty else float(seen.distance(point))

    def _is_behind_walls(self, here: Point, shape: BaseGeometry) -> bool:
        """Return whether walls certainly hide all of a footprint; False if uncertain.

        A fast test that avoids the geometry of shadows.
        """
        outline = shapely.get_coordinates(shape) - here
        x, y = outline.sum(axis=0)
        ahead = outline @ (x, y)
        if ahead.min() <= 0:
            return False
        directions = np.arctan2(outline @ (-y, x), ahead)
        right, left = directions.min() - _ROUNDING_M, directions.max() + _ROUNDING_M
        faces = self._faces_seen_from(here)
        first = (faces.first_rad - math.atan2(y, x) + math.pi) % math.tau - math.pi
        between = (first < left) & (first + faces.width_rad > right)
        start, along, first = faces.start[between], faces.along[between], first[between]
        side = along[:, :1] * (outline[:, 1] - start[:, 1:]) - along[:, 1:] * (outline[:, 0] - start[:, :1])
        before = (side > 0).all(axis=1)
        covered = right
        spans = zip(first[before].tolist(), faces.width_rad[between][before].tolist(), strict=True)
        for begins, width in sorted(spans):
            if begins > covered + _SLIT_RAD:
                return False
            covered = max(covered, begins + width)
        return bool(covered >= left)

    def _faces_seen_from(self, here: Point) -> _Faces:
        """Return the walls' faces that are turned to a point; the last result is cached."""
        if self._faces is None or self._faces.here != here:
            start, end = _facing(self._edges, here)
            first = np.arctan2(end[:, 1], end[:, 0])
            width = (np.arctan2(start[:, 1], start[:, 0]) - first) % math.tau
            self._faces = _Faces(here, start, end - start, first, width)
        return self._faces

    def region(self, shape: BaseGeometry, within_m: float) -> BaseGeometry:
        """Return the region from which a footprint is in sight and nearer than `within_m`.

        Accurate to about a centimetre near walls.
        """
        known = (shape.wkb, within_m)
        if known not in self._regions:
            self._regions[known] = self._region(shape, within_m)
        return self._regions[known]

    def _region(self, shape: BaseGeometry, within_m: float) -> BaseGeometry:
        reach = shape.buffer(within_m, quad_segs=_CIRCLE_QUARTER)
        if not self.walls.intersects(reach):
            return reach
        around = shapely.segmentize(shape.boundary if shape.area else shape, _SAMPLE_M)  # a point has no boundary
        samples = [(x, y) for x, y in shapely.get_coordinates(around) if not self.walls.contains(shapely.Point(x, y))]
        seen: list[BaseGeometry] = [shape]
        for x, y in samples:
            disc = shapely.Point(x, y).buffer(within_m, quad_segs=_CIRCLE_QUARTER)
            seen.append(disc.difference(self._shadows((x, y), disc)))
        return shapely.union_all(seen).difference(self.walls)

    def _shadows(self, here: Point, within: BaseGeometry) -> BaseGeometry:
        """Return the area behind the walls in `within`, seen from a point outside the walls."""
        start, end = _facing(self._edges[shapely.intersects(self._edge_lines, within)], here)
        behind = shapely.polygons(np.stack([start, end, _FAR * end, _FAR * start], axis=1) + np.array(here))
        return shapely.union_all(behind).buffer(_ROUNDING_M)


def _facing(edges: Floats, here: Point) -> tuple[Floats, Floats]:
    """Return left and right ends (N, 2), relative to a point, of the edges that are turned to it."""
    start, end = edges[:, 0] - here, edges[:, 1] - here
    facing = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0] < -_EDGE_ON
    return start[facing], end[facing]


_CACHE: dict[str, Sight] = {}
_CACHE_SIZE = 8


def sight(site: Site) -> Sight:
    """Return the lines of sight of a site, cached by the site's content."""
    if site.sha256 not in _CACHE:
        while len(_CACHE) >= _CACHE_SIZE:
            del _CACHE[next(iter(_CACHE))]
        _CACHE[site.sha256] = Sight(site)
    return _CACHE[site.sha256]
