"""The topological graph: places where the robot scanned, the views from there, and the open candidates.

A candidate is a sub-goal in the direction of a view. Its score is the view's value, plus the detector's confidence and
a bonus if the goal is seen. Near candidates are preferred; visited candidates are dropped.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

from vsnbench.models.vlv.planner import Point
from vsnbench.models.vlv.settings import VLVSettings


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place to go next, in the direction of a view."""

    point: Point
    node: int
    """Index of the node of its view."""
    value: float
    """Value of the view; 0 without a value network."""
    confidence: float
    """The detector's best score for the goal; 0 if it is not seen, which includes scores under the threshold."""
    score: float
    """Value, plus confidence and bonus if the goal is seen."""

    @classmethod
    def of_view(cls, point: Point, node: int, value: float, confidence: float, settings: VLVSettings) -> Self:
        """Return the candidate of a view, with its score."""
        score = value + (confidence + settings.detection_bonus if confidence > 0 else 0.0)
        return cls(point, node, value, confidence, score)


@dataclass(slots=True)
class TopologicalGraph:
    """The memory of the high level."""

    settings: VLVSettings
    nodes: list[Point] = field(default_factory=list)
    """Places where the robot scanned; an edge leads from each to the next."""
    open_candidates: list[Candidate] = field(default_factory=list)
    visited: list[Point] = field(default_factory=list)

    def add_node(self, point: Point, candidates: Iterable[Candidate]) -> None:
        """Add a place where the robot scanned, with its candidates."""
        self.nodes.append(point)
        self.open_candidates.extend(candidates)
        self.visit(point)

    def visit(self, point: Point) -> None:
        """Mark a point as visited, and drop the candidates near it."""
        self.visited.append(point)
        self.open_candidates = [
            item for item in self.open_candidates if math.dist(item.point, point) >= self.settings.visited_radius_m
        ]

    def is_visited(self, point: Point) -> bool:
        """Return whether the robot has been near a point."""
        return any(math.dist(point, visited) < self.settings.visited_radius_m for visited in self.visited)

    def take_best(self, ways_m: list[float], novelty: list[float]) -> tuple[Candidate, float] | None:
        """Remove the best open candidate that can be reached. Returns it with its path length; None without any.

        Args:
            ways_m: path length from the robot to each open candidate; infinite if there is no path.
            novelty: weighted share of unknown space around each candidate.
        """
        weight, reach_m = self.settings.nearness_weight, self.settings.nearness_reach_m
        totals = [
            (item.score + new + weight * max(reach_m - way_m, 0.0) / reach_m, index)
            for index, (item, way_m, new) in enumerate(zip(self.open_candidates, ways_m, novelty, strict=True))
            if math.isfinite(way_m)
        ]
        if not totals:
            return None
        _, best = max(totals, key=lambda pair: pair[0])  # the first of equal ones
        return self.open_candidates.pop(best), ways_m[best]
