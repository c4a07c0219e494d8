"""Distance in sight: along straight lines on the floor plan that no wall and no closed door crosses; furniture may.

A person with a tape cannot measure through a wall either. Windows are wall, and so is a wall of any height: survey
what one looks and reaches over as an object.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Point, Site
from vsnbench.protocol.walls import wall_shapes

_CRACK_M = 0.02
"""Nobody looks or measures through a gap between two walls that is narrower than this: it is the survey's rounding."""
_GRAZE_M = 1e-3
"""So deep into a wall a line may go along its face."""
_SAMPLE_M = 0.05
"""How densely a footprint's outline is sampled for the region from which it is in sight."""
_FAR = 1e4
"""A wall's shadow reaches so many times as far as the wall itself."""
_ROUNDING_M = 1e-6
_CIRCLE_QUARTER = 64
"""Segments of a quarter circle in outlines: 0.08 mm off at 1 m."""
_EDGE_ON = 1e-12
"""A face turned to the eye by less, square metres, is looked along."""
_SLIT_RAD = 1e-7
"""Two faces are one where no more is between them: rounding of angles, a micrometre at 10 m."""


@dataclass(frozen=True, slots=True, eq=False)
class _Faces:
    """Straight faces of walls seen from a point, each from its left end to its right: (N, 2) metres from there."""

    here: Point
    start: npt.NDArray[np.float64]
    along: npt.NDArray[np.float64]
    first_rad: npt.NDArray[np.float64]
    """Direction of the right end."""
    width_rad: npt.NDArray[np.float64]


class Sight:
    """Who sees what on a site's floor plan. Make it with `sight`, which keeps the last ones."""

    def __init__(self, site: Site) -> None:
        """Take the walls of a site, with cracks between them closed."""
        solid = shapely.union_all(wall_shapes(site))
        closed = solid.buffer(_CRACK_M / 2, join_style="mitre").buffer(-_CRACK_M / 2, join_style="mitre")
        self.walls: BaseGeometry = closed.buffer(-_GRAZE_M, join_style="mitre")
        """What blocks sight, metres in the site's frame."""
        shapely.prepare(self.walls)
        parts = shapely.orient_polygons(shapely.get_parts(self.walls))  # whoever faces an edge has it run to the right
        corners, ring = shapely.get_coordinates(shapely.get_rings(parts), return_index=True)
        same = ring[:-1] == ring[1:]
        self._edges: npt.NDArray[np.float64] = np.stack([corners[:-1][same], corners[1:][same]], axis=1)
        self._edge_lines = np.asarray(shapely.linestrings(self._edges), dtype=object)
        self._regions: dict[tuple[bytes, float], BaseGeometry] = {}
        self._faces: _Faces | None = None

    def distance_m(self, here: Point, shape: BaseGeometry) -> float:
        """Return the distance from a point to what it sees of a footprint; 0 inside it, inf when it sees nothing."""
        point = shapely.Point(here)
        if not self.walls.intersects(shapely.shortest_line(point, shape)):
            return float(shape.distance(point))
        if self.walls.contains(point) or self._is_behind_walls(here, shape):
            return math.inf
        between = shapely.union(point, shape).convex_hull
        seen = shape.difference(self._shadows(here, between))
        return math.inf if seen.is_empty else float(seen.distance(point))

    def _is_behind_walls(self, here: Point, shape: BaseGeometry) -> bool:
        """Return whether wall after wall stands before all of a footprint; False where that is not plain.

        It spares the geometry of shadows, which would come out empty there.
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

    def _faces_seen_from(self, here: Point) -> "_Faces":
        """Return the walls' faces that are turned to a point; the last answer is kept."""
        if self._faces is None or self._faces.here != here:
            start, end = self._edges[:, 0] - here, self._edges[:, 1] - here
            facing = _cross(start, end) < -_EDGE_ON
            start, end = start[facing], end[facing]
            first = np.arctan2(end[:, 1], end[:, 0])
            width = (np.arctan2(start[:, 1], start[:, 0]) - first) % math.tau
            self._faces = _Faces(here, start, end - start, first, width)
        return self._faces

    def region(self, shape: BaseGeometry, within_m: float) -> BaseGeometry:
        """Return from where a footprint is in sight and nearer than `within_m`; to about a centimetre near walls."""
        known = (shape.wkb, within_m)
        if known not in self._regions:
            self._regions[known] = self._region(shape, within_m)
        return self._regions[known]

    def _region(self, shape: BaseGeometry, within_m: float) -> BaseGeometry:
        reach = shape.buffer(within_m, quad_segs=_CIRCLE_QUARTER)
        if not self.walls.intersects(reach):
            return reach
        around = shapely.segmentize(shape.boundary, _SAMPLE_M)
        samples = [(x, y) for x, y in shapely.get_coordinates(around) if not self.walls.contains(shapely.Point(x, y))]
        seen: list[BaseGeometry] = [shape]
        for x, y in samples:
            disc = shapely.Point(x, y).buffer(within_m, quad_segs=_CIRCLE_QUARTER)
            seen.append(disc.difference(self._shadows((x, y), disc)))
        return shapely.union_all(seen).difference(self.walls)

    def _shadows(self, here: Point, within: BaseGeometry) -> BaseGeometry:
        """Return everything that lies behind the walls in `within`, seen from a point outside them."""
        edges = self._edges[shapely.intersects(self._edge_lines, within)]
        start, end = edges[:, 0] - here, edges[:, 1] - here
        facing = _cross(start, end) < -_EDGE_ON
        start, end = start[facing], end[facing]
        behind = shapely.polygons(np.stack([start, end, _FAR * end, _FAR * start], axis=1) + np.array(here))
        return shapely.union_all(behind).buffer(_ROUNDING_M)


def _cross(first: npt.NDArray[np.float64], second: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


_KEPT: dict[str, Sight] = {}
_KEEP = 8


def sight(site: Site) -> Sight:
    """Return who sees what in a site; the last few are kept, by the site's content."""
    if site.sha256 not in _KEPT:
        while len(_KEPT) >= _KEEP:
            del _KEPT[next(iter(_KEPT))]
        _KEPT[site.sha256] = Sight(site)
    return _KEPT[site.sha256]
