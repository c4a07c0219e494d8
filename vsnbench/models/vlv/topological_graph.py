"""The topological graph: places where the robot scanned, the views from there, and the open candidates.

A candidate is a sub-goal in the direction of a view. Its score is the view's value, plus the detector's confidence and
a bonus if the goal is seen. Near candidates are preferred; visited candidates are dropped.
"""

import math
from dataclasses import dataclass, field

from vsnbench.models.vlv.settings import VLVSettings

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class View:
    """One view of a scan."""

    heading_rad: float
    """Heading of the camera in the start's frame."""
    value: float
    """Value of this direction; 0 without a value network."""
    confidence: float
    """The detector's best score for the goal; 0 if it is not seen, which includes scores under the threshold."""

    def score(self, settings: VLVSettings) -> float:
        """Return value, plus confidence and bonus if the goal is seen."""
        seen = self.confidence > 0
        return self.value + (self.confidence + settings.detection_bonus if seen else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place to go next."""

    point: Point
    node: int
    """Index of the node of its view."""
    view: View
    score: float


@dataclass(frozen=True, slots=True)
class Node:
    """A place where the robot scanned."""

    point: Point
    views: tuple[View, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A candidate with its current rank."""

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
        """Add a place with its views and candidates. Returns its index."""
        self.nodes.append(Node(point, views))
        if len(self.nodes) > 1:
            self.edges.append((len(self.nodes) - 2, len(self.nodes) - 1))
        self.open_candidates.extend(candidates)
        self.visit(point)
        return len(self.nodes) - 1

    def visit(self, point: Point) -> None:
        """Mark a point as visited, and drop the candidates near it."""
        self.visited.append(point)
        self.open_candidates = [
            item for item in self.open_candidates if math.dist(item.point, point) >= self.settings.visited_radius_m
        ]

    def is_visited(self, point: Point) -> bool:
        """Return whether the robot has been near a point."""
        return any(math.dist(point, visited) < self.settings.visited_radius_m for visited in self.visited)

    def close(self, candidate: Candidate) -> None:
        """Remove a candidate from the open list."""
        self.open_candidates = [item for item in self.open_candidates if item is not candidate]

    def ranked(self, ways_m: list[float], novelty: list[float]) -> list[Ranked]:
        """Return the open candidates that can be reached, best first.

        Args:
            ways_m: path length from the robot to each open candidate; infinite if there is no path.
            novelty: weighted share of unknown space around each candidate.
        """
        reach_m = self.settings.nearness_reach_m
        ranked = [
            Ranked(item, way_m, item.score + new + self.settings.nearness_weight * max(reach_m - way_m, 0.0) / reach_m)
            for item, way_m, new in zip(self.open_candidates, ways_m, novelty, strict=True)
            if math.isfinite(way_m)
        ]
        return sorted(ranked, key=lambda item: -item.total)
