"""Memory of where the goal was seen: detections with depth become places in the start's frame."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.detectors.contract import Detection, Reliability
from vsnbench.models.vlv.planner import Point
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

_SAME_PLACE_M: Final = 1.0
_SAME_SPOT_M: Final = 0.6
_MAX_SPOTS: Final = 60
_POINTS_PER_OBSERVATION: Final = 20
_MISSES_OF_A_SPOT: Final = 3
_NEAR_SHARE: Final = 10
"""Percentile of a mask's distances that is taken as the object's: a mask's edge often includes the background."""


@dataclass(frozen=True, slots=True, eq=False)
class GoalSurface:
    """What a detection shows of the goal, with its depth."""

    distance_m: float
    """Horizontal distance from the base's centre to its nearest part; NaN without valid depth."""
    points: npt.NDArray[np.float64]
    """(N, 2) points of its surface in the start's frame, metres; empty without valid depth."""


@dataclass(slots=True, eq=False)
class GoalPlace:
    """A place where the goal was seen."""

    points: npt.NDArray[np.float64]
    """(N, 2) points of the goal's surface in the start's frame, metres."""
    point_misses: npt.NDArray[np.int64]
    """(N,) consecutive misses of each point."""
    observations: int = 1
    misses: int = 0
    failed_observations: int = 0
    """Consecutive observations from nearby without a detection."""

    def evidence(self, reliability: Reliability) -> float:
        """Return the number of views that support it, less the weighted number of those that do not."""
        return self.observations - reliability.miss_weight * self.misses

    @property
    def centre(self) -> Point:
        """The median of its points."""
        x_m, y_m = np.median(self.points, axis=0)
        return (float(x_m), float(y_m))

    def distance_m(self, point: Point) -> float:
        """Distance from a point to the place, without the nearest points, which can be wrong."""
        return float(np.percentile(np.hypot(*(self.points - point).T), _NEAR_SHARE))

    def nearest_m(self, point: Point) -> float:
        """Distance from a point to the nearest of its points."""
        return float(np.hypot(*(self.points - point).T).min())


def surface_of(detection: Detection, depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose) -> GoalSurface:
    """Return the surface of a detected object, whose mask has the size of the depth image (H, W).

    `pose` is that of the base in the start's frame.
    """
    height, width = depth_m.shape
    rays = camera.rays(width, height)
    rows, columns = np.nonzero(detection.mask & np.isfinite(depth_m))
    if rows.size == 0:
        return GoalSurface(math.nan, np.zeros((0, 2)))
    ahead, left, _ = rays.points(depth_m[rows, columns], rows, columns)
    flat = np.hypot(ahead, left)
    distance_m = float(np.percentile(flat, _NEAR_SHARE))
    # Points far behind the object's front belong to the wall behind the edge of its mask.
    on_it = np.flatnonzero((flat >= distance_m) & (flat <= np.median(flat) + 0.5))
    chosen = on_it[np.linspace(0, on_it.size - 1, min(_POINTS_PER_OBSERVATION, on_it.size)).astype(int)]
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x_m = pose.x_m + cos * ahead[chosen] - sin * left[chosen]
    y_m = pose.y_m + sin * ahead[chosen] + cos * left[chosen]
    return GoalSurface(distance_m, np.column_stack((x_m, y_m)))


@dataclass(slots=True)
class GoalMemory:
    """The places of an episode."""

    reliability: Reliability
    places: list[GoalPlace] = field(default_factory=list)

    @property
    def believed(self) -> list[GoalPlace]:
        """The places that enough views support: a detector seldom errs twice at the same place.

        A weak detector does err twice, so only its best place counts.
        """
        evidence = [place.evidence(self.reliability) for place in self.places]
        least: float = self.reliability.views_to_believe
        if self.reliability.is_measured:
            least = max([least, *evidence])
        return [place for place, views in zip(self.places, evidence, strict=True) if views >= least]

    def update(self, sightings: Sequence[GoalSurface], should_see: Callable[[Point], bool]) -> None:
        """Update the places with an observation. Sightings without depth are ignored.

        `should_see` returns whether a goal at a point should be detected in this observation.
        """
        with_depth = [item for item in sightings if item.points.shape[0]]
        seen: set[int] = set()
        for item in with_depth:
            seen.add(id(self._see(item, seen)))
        surfaces = np.concatenate([item.points for item in with_depth]) if with_depth else np.zeros((0, 2))
        for place in list(self.places):
            expected = [number for number, (x_m, y_m) in enumerate(place.points.tolist()) if should_see((x_m, y_m))]
            for number in expected:
                away_m = np.hypot(*(surfaces - place.points[number]).T)
                again = surfaces.size and float(away_m.min()) < _SAME_SPOT_M
                place.point_misses[number] = 0 if again else place.point_misses[number] + 1
            weight = self.reliability.miss_weight
            kept = weight * place.point_misses < _MISSES_OF_A_SPOT
            place.points, place.point_misses = place.points[kept], place.point_misses[kept]
            if expected and id(place) not in seen:
                place.misses += 1
            if not place.points.size or weight * place.misses > place.observations:
                self.places.remove(place)

    def _see(self, item: GoalSurface, seen: set[int]) -> GoalPlace:
        """Add a sighting to its place, or as a new place. `seen` has the ids of the places seen in this view."""
        misses = np.zeros(len(item.points), np.int64)
        middle = (float(np.median(item.points[:, 0])), float(np.median(item.points[:, 1])))
        near = [place for place in self.places if place.nearest_m(middle) < _SAME_PLACE_M]
        if near:
            place = min(near, key=lambda place: place.nearest_m(middle))
            place.points = np.concatenate((place.points, item.points))[-_MAX_SPOTS:]
            place.point_misses = np.concatenate((place.point_misses, misses))[-_MAX_SPOTS:]
            if not self.reliability.is_measured or id(place) not in seen:  # a second box is not a second view
                place.observations += 1
            place.failed_observations = 0
            return place
        self.places.append(GoalPlace(item.points, misses))
        return self.places[-1]
