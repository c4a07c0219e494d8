"""From depth images to a measured placement: search, fit, doubt, and what in the room differs from the plan."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.placement.differences import gone, suspects
from vsnbench.placement.fit import ErrorModel, Fit, FitState
from vsnbench.placement.looks import DepthLook, Sighting, SmallLook
from vsnbench.placement.search import (
    REACH_DEG,
    REACH_M,
    Candidate,
    along_surfaces,
    candidates,
    misfit_of,
    near,
    polished,
)
from vsnbench.placement.twin import Twin, twin_of
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site, StartingPosition

Floats = npt.NDArray[np.float64]

_COARSE_PX, _MIDDLE_PX, _FINE_PX = 40, 80, 160
_CANDIDATES, _POLISHED, _BASINS = 8, 4, 5
"""Places of the grid that are fitted roughly, how many of them are polished besides, and how many are fitted on."""
_UNDETERMINED_M, _UNDETERMINED_RAD = 0.10, math.radians(4.0)
"""A direction whose standard deviation is larger is not determined by the view."""
_MISFIT_LIMIT = 0.15
_FINEST_M = 0.04
"""Width of the robust loss at the end."""
_DOUBT = 0.015
"""A basin that misfits by so much more than the best has e times less weight."""
_LEAST_WEIGHT = 0.03
"""A basin of less weight is none: the region leaves out as much anyway."""
_LEAST_SEEN = 60
"""Pixels of a small look; with fewer there is nothing to go by."""
_MOST_SEARCHED = 5
"""Looks of a turn that the search goes by; the fit takes all."""


class PlacementMatcher:
    """Measures where a robot with this camera stands in this site; one thread at a time."""

    def __init__(self, site: Site, camera: Camera, errors: ErrorModel | None = None) -> None:
        self._twin: Twin = twin_of(site)
        self._site = site
        self._camera = camera
        self._errors = errors or ErrorModel.of(site)

    def measure(
        self, start: StartingPosition, looks: Sequence[DepthLook], tolerance: PlacementTolerance | None = None
    ) -> MeasuredPlacement:
        """Measure where the robot stood at the last look.

        Args:
            start: where it should stand.
            looks: one or more depth images near there, with the odometry they were taken at.
            tolerance: how far off it may stand; the protocol's default when None.
        """
        began_s = time.perf_counter()
        errors = self._errors
        placed = _from_the_first(looks)
        fine = self._sighting(placed, _FINE_PX)
        basins, beside = self._basins(placed, start.pose)
        if basins:
            best = basins[0]
            fit = Fit(fine, errors, left_out=best.moved)
            state = fit.refined(best.state, 4, (0.06, _FINEST_M))
            state = replace(state, covariance=fit.doubt(state, _FINEST_M))
            covariance = state.covariance_of(fine.looks[-1]) + _of_other_places(state, basins) + beside
            misfit = best.misfit
        else:
            state, misfit = FitState(start.pose), 0.0
            covariance = np.diag([errors.pose_m, errors.pose_m, errors.pose_rad]) ** 2
        now = state.pose_of(fine.looks[-1])
        undetermined = _undetermined(covariance, now)
        fits = misfit < _MISFIT_LIMIT and _within_reach(state.pose, start.pose)
        moved = gone(fine, state) if fits and not undetermined else frozenset[int]()
        return MeasuredPlacement(
            start=start.number,
            mark=start.pose,
            pose=now,
            covariance=PoseCovariance.of(covariance),
            tolerance=tolerance or PlacementTolerance(),
            method=PlacementMethod.LOOK if len(looks) == 1 else PlacementMethod.TURN,
            looks=len(looks),
            fits=fits,
            undetermined=undetermined,
            moved=tuple(self._site.objects[group].id for group in sorted(moved)),
            depth_scale=state.scale,
            took_s=time.perf_counter() - began_s,
        )

    def _sighting(self, looks: Sequence[DepthLook], width: int) -> Sighting:
        return Sighting(self._twin, self._camera, [SmallLook.of(look, self._camera, width) for look in looks])

    def _basins(self, looks: Sequence[DepthLook], mark: Pose) -> "tuple[list[_Basin], Floats]":
        """Return the places where the robot may stand, best first, and what others beside it add to its covariance.

        There are none where next to nothing is seen.
        """
        middle = self._sighting(looks, _MIDDLE_PX)
        coarse = [
            look for look in self._sighting(looks, _COARSE_PX).looks if np.isfinite(look.depth_m).sum() >= _LEAST_SEEN
        ]
        if not coarse:
            return [], np.zeros((3, 3))
        sparse = Sighting(self._twin, self._camera, coarse[:: max(1, -(-len(coarse) // _MOST_SEARCHED))])
        rough: list[_Basin] = []
        for number, one in enumerate(candidates(sparse, mark, _CANDIDATES)):
            if number < _POLISHED:
                better = polished(sparse, one)
                rough.append(_Basin(FitState.at(better.pose, self._twin), better.misfit, frozenset()))
            state = Fit(sparse, self._errors).refined(FitState.at(one.pose, self._twin), 6, (0.25, 0.10))
            if _within_reach(state.pose, mark):
                rough.append(_Basin(state, _misfit(sparse, state), frozenset()))
        settled = [self._settled(middle, basin.state) for basin in _apart(rough)[:_BASINS]]
        basins = _apart([one for one in settled if _within_reach(one.state.pose, mark)] or settled)
        # What may compete is fitted to its end: on the way to the best place it would be taken for another one.
        rivals = [basin for basin, weight in zip(basins, _weights(basins), strict=True) if weight][1:]
        rivals = [self._settled(middle, basin.state) for basin in rivals]
        basins = _apart([basins[0], *(one for one in rivals if _within_reach(one.state.pose, mark))])
        return basins, self._beside(sparse, basins[0])

    def _beside(self, sparse: Sighting, best: "_Basin") -> Floats:
        """Return what places along a surface that fit about as well add to the (3, 3) covariance of the best."""
        state = best.state
        misfit = _misfit(sparse, state)
        tried = along_surfaces(sparse, Candidate(state.pose, misfit), state.scale)
        as_well = [one for one in tried if one.misfit < misfit + _DOUBT]
        if not as_well:
            return np.zeros((3, 3))
        weights = np.array([math.exp((misfit - one.misfit) / _DOUBT) for one in as_well])
        away = np.array([_difference(one.pose, state.pose) for one in as_well])
        return np.asarray(np.einsum("b,bi,bj->ij", weights / weights.sum(), away, away))

    def _settled(self, middle: Sighting, state: FitState) -> "_Basin":
        """Fit on, without what turns out to stand elsewhere."""
        state = Fit(middle, self._errors).refined(state, 3, (0.12, 0.06))
        moved = suspects(middle, state, self._errors)
        if moved:
            state = Fit(middle, self._errors, left_out=moved).refined(state, 3, (0.10, 0.06))
            moved |= suspects(middle, state, self._errors)
        return _Basin(state, _misfit(middle, state), moved)


@dataclass(frozen=True, slots=True)
class _Basin:
    """A place where the robot may stand."""

    state: FitState
    misfit: float
    moved: frozenset[int]


def _misfit(sighting: Sighting, state: FitState) -> float:
    return misfit_of(sighting, [state.pose_of(look) for look in sighting.looks], state.scale)


def _apart(basins: Sequence[_Basin]) -> list[_Basin]:
    """Return the best first, without those that came to the same place as a better one."""
    kept: list[_Basin] = []
    for one in sorted(basins, key=lambda each: each.misfit):
        if not any(near(one.state.pose, other.state.pose, 0.2) for other in kept):
            kept.append(one)
    return kept


def _within_reach(pose: Pose, mark: Pose) -> bool:
    off = pose.relative_to(mark)
    return math.hypot(*off.position) < REACH_M + 0.10 and abs(math.remainder(off.heading_rad, math.tau)) < math.radians(
        REACH_DEG + 4
    )


def _of_other_places(state: FitState, basins: Sequence[_Basin]) -> Floats:
    """Return what other places add to the (3, 3) covariance of the pose, by how well they fit beside the best."""
    weights = _weights(basins)
    away = np.array([_difference(basin.state.pose, state.pose) for basin in basins])
    away[0] = 0.0
    return np.asarray(np.einsum("b,bi,bj->ij", weights / weights.sum(), away, away))


def _weights(basins: "Sequence[_Basin]") -> Floats:
    """Return (B,) how well each fits beside the best, which comes first and has 1; 0 for those that do not count."""
    weights = np.array([math.exp((basins[0].misfit - basin.misfit) / _DOUBT) for basin in basins])
    return np.where(weights < _LEAST_WEIGHT, 0.0, weights)


def _difference(one: Pose, other: Pose) -> tuple[float, float, float]:
    turned_rad = math.remainder(one.heading_rad - other.heading_rad, math.tau)
    return (one.x_m - other.x_m, one.y_m - other.y_m, turned_rad)


def _from_the_first(looks: Sequence[DepthLook]) -> list[DepthLook]:
    """Return the looks with their odometry from the first one on, headings counted on beyond a full turn."""
    first = looks[0].odometry
    away = [look.odometry.relative_to(first) for look in looks]
    headings = np.unwrap([pose.heading_rad for pose in away])
    headings -= headings[0]
    return [
        DepthLook(look.depth_m, Pose(pose.x_m, pose.y_m, float(heading)))
        for look, pose, heading in zip(looks, away, headings, strict=True)
    ]


def _undetermined(covariance: Floats, pose: Pose) -> tuple[str, ...]:
    """Return in words which directions are not determined."""
    words: list[str] = []
    values, axes = np.linalg.eigh(covariance[:2, :2])
    if math.sqrt(values[0]) > _UNDETERMINED_M:
        words += ["forward-back", "left-right"]
    elif math.sqrt(values[1]) > _UNDETERMINED_M:
        along_rad = math.atan2(axes[1, 1], axes[0, 1]) - pose.heading_rad
        slant = abs(math.remainder(along_rad, math.pi))
        across, ahead = slant > math.radians(67), slant < math.radians(23)
        words.append("left-right" if across else "forward-back" if ahead else "the place along one line")
    if math.sqrt(covariance[2, 2]) > _UNDETERMINED_RAD:
        words.append("heading")
    return tuple(words)
