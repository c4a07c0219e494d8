"""What a robot did on its way: furthest stage, clearance, and when the goal was in view, from site map and poses.

Everything here is derived from the record: the site, the protocol, the robot's profile and the poses after each action.
A measure is None where one of them is missing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.judge import success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.geometry.line_of_sight import sight
from vsnbench.sites.geometry.walls import solid_objects, solid_shapes
from vsnbench.sites.site import Site
from vsnbench.sites.targets import Target, legs_of, targets_of
from vsnbench.values.pose import Pose

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

APPROACHED = 0.5
"""Share of the shortest path at the start that may remain when the goal counts as approached."""
_SAMPLE_M = 0.05
"""Distance between the points of a path at which clearance is measured."""


_Goal = tuple[Sequence[Target], BaseGeometry]


class Stage(StrEnum):
    """How far an episode came; the last one whose condition held at any pose."""

    NONE = "none"
    SEEN = "seen"
    """An instance was in the camera's horizontal field of view, and no wall was in between."""
    APPROACHED = "approached"
    """The shortest path to the success region was at most half of that at the start."""
    REACHED = "reached"
    """STOP would have succeeded."""
    STOPPED = "stopped"
    """The episode succeeded."""


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """How a robot came near a goal, by pose."""

    in_view: Flags | None
    """(n,) an instance is in the field of view with no wall in between; furniture does not hide. None if the field of
    view is unknown."""
    remaining_m: Floats
    """(n,) shortest path to the success region; inf where there is none."""
    reached: Flags
    """(n,) STOP would succeed."""

    def stage(self, succeeded: bool) -> Stage | None:
        """Return the furthest stage; None if nothing but a sighting is possible and the field of view is unknown."""
        if succeeded:
            return Stage.STOPPED
        if self.reached.any():
            return Stage.REACHED
        first_m = float(self.remaining_m[0])
        if math.isfinite(first_m) and float(self.remaining_m.min()) <= APPROACHED * first_m:
            return Stage.APPROACHED
        if self.in_view is None:
            return None
        return Stage.SEEN if self.in_view.any() else Stage.NONE


class CourseMap:
    """A site and a robot, for measuring the courses of episodes."""

    def __init__(
        self, site: Site, radius_m: float, field_of_view_deg: float | None, parameters: ProtocolParameters
    ) -> None:
        """Prepare the map.

        Args:
            site: the site.
            radius_m: radius of the robot's base.
            field_of_view_deg: horizontal field of view of its camera; None if unknown.
            parameters: rules of the trials.
        """
        self.site, self._radius_m, self._parameters = site, radius_m, parameters
        self._half_view_rad = None if field_of_view_deg is None else math.radians(field_of_view_deg) / 2
        self._solids = shapely.STRtree(solid_shapes(site))
        self._goals: dict[str, _Goal | None] = {}

    def approach(self, goal: str, poses: Sequence[Pose]) -> Approach | None:
        """Return how the robot came near a goal; None for a sequence, and without targets or poses."""
        if not poses or (found := self._of_goal(goal)) is None:
            return None
        targets, region = found
        space = free_space(self.site, self._radius_m)
        places = np.array([pose.position for pose in poses], np.float64)
        return Approach(
            in_view=self._in_view(targets, poses, places),
            remaining_m=space.geodesics_to_goal_m(places, goal, self._parameters),
            reached=_within(region, places),
        )

    def reached(self, goal: str, poses: Sequence[Pose]) -> Flags | None:
        """Return by pose (n,) whether STOP would succeed; None without targets, as for a sequence."""
        if (found := self._of_goal(goal)) is None:
            return None
        return _within(found[1], np.array([pose.position for pose in poses], np.float64).reshape(-1, 2))

    def clearances_m(self, poses: Sequence[Pose]) -> Floats:
        """Return the distances between the edge of the base and the nearest solid of the map.

        They are measured every 5 cm along the straight lines between the poses; none without poses.
        """
        if not poses:
            return np.empty(0)
        line = shapely.LineString([poses[0].position, *(pose.position for pose in poses)])
        along = np.append(np.arange(0.0, line.length, _SAMPLE_M), line.length)
        points = np.asarray(shapely.line_interpolate_point(line, along), dtype=object)
        _, centre_m = self._solids.query_nearest(points, return_distance=True, all_matches=False)
        return np.maximum(np.asarray(centre_m, np.float64) - self._radius_m, 0.0)

    def solid_ahead(self, pose: Pose) -> str:
        """Return what the depth guard finds ahead of a robot at a pose: `wall`, or the id of an object; else nothing.

        An id is shortened to its category where the site has one object of it.
        """
        reach_m = self._radius_m + self._parameters.depth_guard.distance_m
        ahead = pose.compose(Pose(reach_m, 0.0))
        way = shapely.LineString([pose.position, ahead.position]).buffer(self._radius_m)
        found = self._solids.query(way, predicate="intersects")
        if not len(found):
            return ""
        away_m = shapely.distance(self._solids.geometries[found], shapely.Point(pose.position))
        nearest = int(found[int(np.argmin(away_m))])
        things = solid_objects(self.site)
        number = nearest - (len(self._solids.geometries) - len(things))
        if number < 0:
            return "wall"
        thing = things[number]
        return thing.category if len(self.site.instances(thing.category)) == 1 else thing.id

    def _of_goal(self, goal: str) -> _Goal | None:
        """Return the targets of a goal and its success region; None if the site has no target of it."""
        if goal not in self._goals:
            targets = () if len(legs_of(self.site, goal)) > 1 else targets_of(self.site, goal)  # each leg has its own
            region = success_region(self.site, goal, self._parameters) if targets else None
            if region is not None:
                shapely.prepare(region)
            self._goals[goal] = None if region is None else (targets, region)
        return self._goals[goal]

    def _in_view(self, targets: Sequence[Target], poses: Sequence[Pose], places: Floats) -> Flags | None:
        if self._half_view_rad is None:
            return None
        walls = sight(self.site).walls
        here = np.asarray(shapely.points(places), dtype=object)
        headings = np.array([pose.heading_rad for pose in poses], np.float64)
        seen = np.zeros(len(poses), bool)
        for target in targets:
            centre = np.array([target.shape.centroid.x, target.shape.centroid.y])
            nearest = shapely.get_coordinates(shapely.shortest_line(here, target.shape)).reshape(-1, 2, 2)[:, 1]
            for ends in (nearest, np.broadcast_to(centre, places.shape)):
                way = ends - places
                off = np.angle(np.exp(1j * (np.arctan2(way[:, 1], way[:, 0]) - headings)))
                facing = ~seen & (np.abs(off) <= self._half_view_rad)
                lines = shapely.linestrings(np.stack([places[facing], ends[facing]], axis=1))
                seen[facing] = ~np.asarray(shapely.intersects(walls, lines), bool)
        return seen


def _within(region: BaseGeometry, places: Floats) -> Flags:
    return np.asarray(shapely.intersects_xy(region, places[:, 0], places[:, 1]), bool)
