"""The topological graph: places where the robot looked around, the views from there, and the candidates left open.

A candidate is a sub-goal in the direction of a view. Its score is the view's value plus the detector's confidence and
a bonus where the goal is seen; near candidates are preferred, and what the robot has visited is dropped.
"""

import math
from dataclasses import dataclass, field

from vsnbench.models.vlv.settings import VLVSettings

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class View:
    """One look of a scan."""

    heading_rad: float
    """Of the camera, in the start's frame."""
    value: float
    """What the value network expects in this direction; 0 without one."""
    confidence: float
    """The detector's best score for the goal; 0 where it is not seen."""

    def score(self, settings: VLVSettings) -> float:
        """Return value, plus confidence and bonus where the goal was seen."""
        seen = self.confidence >= settings.detector_threshold
        return self.value + (self.confidence + settings.detection_bonus if seen else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place to go next."""

    point: Point
    node: int
    """Index of the node it was seen from."""
    view: View
    score: float


@dataclass(frozen=True, slots=True)
class Node:
    """Where the robot stood and looked around."""

    point: Point
    views: tuple[View, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A candidate as it ranks now."""

    candidate: Candidate
    way_m: float
    total: float


@dataclass(slots=True)
class TopologicalGraph:
    """The memory of the high level."""

    settings: VLVSettings
    nodes: list[Node] = field(default_factory=list)
    edges: list[tuple[int, int]] = field(default_factory=list)
    open_candidates: list[Candidate] = field(default_factory=list)
    visited: list[Point] = field(default_factory=list)

    def add_node(self, point: Point, views: tuple[View, ...], candidates: tuple[Candidate, ...]) -> int:
        """Add a place with what was seen from it; its candidates join those left open before. Return its index."""
        self.nodes.append(Node(point, views))
        if len(self.nodes) > 1:
            self.edges.append((len(self.nodes) - 2, len(self.nodes) - 1))
        self.open_candidates.extend(candidates)
        self.visit(point)
        return len(self.nodes) - 1

    def visit(self, point: Point) -> None:
        """Note that the robot was here, and drop the candidates that this makes pointless."""
        self.visited.append(point)
        self.open_candidates = [
            each for each in self.open_candidates if math.dist(each.point, point) >= self.settings.visited_radius_m
        ]

    def is_visited(self, point: Point) -> bool:
        """Whether the robot was so near that going there is going back."""
        return any(math.dist(point, been) < self.settings.visited_radius_m for been in self.visited)

    def close(self, candidate: Candidate) -> None:
        """Take a candidate off the open list."""
        self.open_candidates = [each for each in self.open_candidates if each is not candidate]

    def ranked(self, ways_m: list[float], novelty: list[float]) -> list[Ranked]:
        """Return the open candidates, best first; those that cannot be reached are left out.

        Args:
            ways_m: the way from the robot to each open candidate, infinite where there is none.
            novelty: how much unknown lies around each, already weighted.
        """
        reach_m = self.settings.nearness_reach_m
        ranked = [
            Ranked(each, way_m, each.score + new + self.settings.nearness_weight * max(reach_m - way_m, 0.0) / reach_m)
            for each, way_m, new in zip(self.open_candidates, ways_m, novelty, strict=True)
            if math.isfinite(way_m)
        ]
        return sorted(ranked, key=lambda each: -each.total)
