"""Measurement of a placement from depth images: search, fit, uncertainty, and differences between room and plan."""

import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsnbench.localization.differences import gone, suspects
from vsnbench.localization.fit import ErrorModel, FitState, PoseFit
from vsnbench.localization.looks import DepthLook, LookSet, SmallLook
from vsnbench.localization.search import (
    MARK_REACH,
    Reach,
    TriedPose,
    along_surfaces,
    candidates,
    misfit_of,
    near,
    polished,
)
from vsnbench.localization.twin import Floats, Twin, twin_of
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.values.pose import Pose

_COARSE_PX, _MIDDLE_PX, _FINE_PX = 40, 80, 160
_CANDIDATES, _POLISHED, _BASINS = 8, 4, 5
"""Number of grid poses that get a rough fit, of those that are refined too, and of those that get the full fit."""
_UNDETERMINED_M, _UNDETERMINED_RAD = 0.10, math.radians(4.0)
"""Maximum standard deviation of a direction that the view determines."""
_MISFIT_LIMIT = 0.15
_FINEST_M = 0.04
"""Width of the robust loss in the last round."""
_DOUBT = 0.015
"""Difference of misfit at which a basin has a weight lower by the factor e."""
_LEAST_WEIGHT = 0.03
"""Minimum weight of a basin; the 95 % region excludes as much anyway."""
_LEAST_SEEN = 60
"""Minimum number of valid pixels of a reduced look."""
_FORWARD_STEP_M, _MOST_CORRECTIONS = 0.02, 4
"""Minimum camera offset, found by a turn, after which the turn is measured again with this offset."""
_MOST_SEARCHED = 5
"""Number of looks of a turn for the search; the fit uses all."""
_SEARCHED_STDS = 2.5
_STOP_REACH_M, _STOP_REACH_DEG = (0.15, 0.45, 1.2), (5.0, 10.0, 30.0)
"""Step, minimum and maximum of the reach of a search around the odometry's pose."""


class PlacementMatcher:
    """Measures the pose of a robot in this site; not thread-safe."""

    def __init__(self, site: Site, errors: ErrorModel | None = None) -> None:
        self._twin: Twin = twin_of(site)
        self._site = site
        self._errors = errors or ErrorModel.of(site)

    def measure(
        self, start: StartingPosition, looks: Sequence[DepthLook], tolerance: PlacementTolerance | None = None
    ) -> MeasuredPlacement:
        """Measure the robot's pose at the last look.

        Args:
            start: starting position near the robot.
            looks: one or more depth images near the start, with their odometry.
            tolerance: tolerance of the placement; default: the protocol's.
        """
        return self._with_camera_corrected(_Expected(start.pose, start.number), looks, tolerance)

    def measure_stop(self, expected: Pose, covariance: PoseCovariance, looks: Sequence[DepthLook]) -> MeasuredPlacement:
        """Measure the robot's pose at the last look of a way, near where the odometry expects it.

        The earlier looks widen the view; the odometry's errors between them are unknowns of the fit.

        Args:
            expected: pose by the odometry in the site's frame.
            covariance: its covariance, which bounds the search.
            looks: depth images of the last steps, the newest last, with their odometry in one frame.
        """
        std_m = math.sqrt(float(np.linalg.eigvalsh(covariance.matrix[:2, :2])[-1]))
        reach = Reach(
            _on_grid(_SEARCHED_STDS * std_m, *_STOP_REACH_M),
            _on_grid(_SEARCHED_STDS * math.degrees(math.sqrt(covariance.hh)), *_STOP_REACH_DEG),
        )
        return self._measured(_Expected(expected, 0, reach, drove=True), looks, None)

    def _with_camera_corrected(
        self, expected: "_Expected", looks: Sequence[DepthLook], tolerance: PlacementTolerance | None
    ) -> MeasuredPlacement:
        measured = self._measured(expected, looks, tolerance)
        forward_m, took_s = measured.forward_m, measured.took_s
        # The linearized fit finds only part of a large step; from its result it finds the rest.
        for _ in range(_MOST_CORRECTIONS):
            if abs(measured.forward_m) < _FORWARD_STEP_M:
                break
            looks = [_with_camera_ahead(look, measured.forward_m) for look in looks]
            measured = self._measured(expected, looks, tolerance)
            forward_m, took_s = forward_m + measured.forward_m, took_s + measured.took_s
        return replace(measured, forward_m=forward_m, took_s=took_s)

    def _measured(
        self, expected: "_Expected", looks: Sequence[DepthLook], tolerance: PlacementTolerance | None
    ) -> MeasuredPlacement:
        began_s = time.perf_counter()
        errors = self._errors
        placed = _to_the_last(looks) if expected.drove else _from_the_first(looks)
        fine = self._sighting(placed, _FINE_PX)
        target = fine.looks[0 if expected.drove else -1]
        basins, along_surface = self._basins(placed, expected)
        if basins:
            best = basins[0]
            fit = PoseFit(fine, errors, left_out=best.moved)
            state = fit.refined(best.state, 4, (0.06, _FINEST_M))
            state = replace(state, covariance=fit.doubt(state, _FINEST_M))
            covariance = state.covariance_of(target) + _of_other_places(state, basins) + along_surface
            if fine.drove:
                covariance += np.diag([0.0, 0.0, errors.wander_rad**2])
            misfit = best.misfit
        else:
            state, misfit = FitState(expected.pose), 0.0
            covariance = np.diag([errors.pose_m, errors.pose_m, errors.pose_rad]) ** 2
        now, turned = state.pose_of(target), len(looks) > 1 and bool(basins) and not expected.drove
        undetermined = _undetermined(covariance, now)
        fits = misfit < _MISFIT_LIMIT and expected.holds(state.pose)
        moved = gone(fine, state) if fits and not undetermined else frozenset[int]()
        return MeasuredPlacement(
            start=expected.number,
            mark=expected.pose,
            pose=now,
            covariance=PoseCovariance.of(covariance),
            tolerance=tolerance or PlacementTolerance(),
            method=expected.method if len(looks) > 1 else PlacementMethod.LOOK,
            looks=len(looks),
            fits=fits,
            undetermined=undetermined,
            moved=tuple(self._site.objects[group].id for group in sorted(moved)),
            depth_scale=state.scale,
            forward_m=state.forward_m if turned else 0.0,
            forward_std_m=state.forward_std_m if turned else math.inf,
            took_s=time.perf_counter() - began_s,
        )

    def _sighting(self, looks: Sequence[DepthLook], width: int) -> LookSet:
        return LookSet(self._twin, [SmallLook.of(look, width) for look in looks])

    def _basins(self, looks: Sequence[DepthLook], expected: "_Expected") -> "tuple[list[_Basin], Floats]":
        """Return the candidate poses, best first, and the covariance that the alternatives add to the best.

        There are no candidates if too little is visible.
        """
        middle = self._sighting(looks, _MIDDLE_PX)
        coarse = [
            look for look in self._sighting(looks, _COARSE_PX).looks if np.isfinite(look.depth_m).sum() >= _LEAST_SEEN
        ]
        if not coarse:
            return [], np.zeros((3, 3))
        sparse = LookSet(self._twin, coarse[:: max(1, -(-len(coarse) // _MOST_SEARCHED))])
        rough: list[_Basin] = []
        for number, candidate in enumerate(candidates(sparse, expected.pose, _CANDIDATES, expected.reach)):
            if number < _POLISHED:
                better = polished(sparse, candidate)
                rough.append(_Basin(FitState.at(better.pose, self._twin), better.misfit, frozenset()))
            state = PoseFit(sparse, self._errors).refined(FitState.at(candidate.pose, self._twin), 6, (0.25, 0.10))
            if expected.holds(state.pose):
                rough.append(_Basin(state, _misfit(sparse, state), frozenset()))
        settled = [self._settled(middle, basin.state) for basin in _apart(rough)[:_BASINS]]
        basins = _apart([basin for basin in settled if expected.holds(basin.state.pose)] or settled)
        # Fit all candidates completely: an unfinished fit near the best pose would count as another one.
        rivals = [basin for basin, weight in zip(basins, _weights(basins), strict=True) if weight][1:]
        rivals = [self._settled(middle, basin.state) for basin in rivals]
        basins = _apart([basins[0], *(basin for basin in rivals if expected.holds(basin.state.pose))])
        return basins, self._along_surface(sparse, basins[0])

    def _along_surface(self, sparse: LookSet, best: "_Basin") -> Floats:
        """Return the (3, 3) covariance that poses along a surface with a similar fit add to the best."""
        state = best.state
        misfit = _misfit(sparse, state)
        if sparse.drove:  # the places differ by the shift alone, not by the odometry's errors as well
            placed = [replace(look, odometry=state.pose_of(look).relative_to(state.pose)) for look in sparse.looks]
            sparse = LookSet(sparse.twin, placed)
        tried = along_surfaces(sparse, TriedPose(state.pose, misfit), state.scale)
        similar = [candidate for candidate in tried if candidate.misfit < misfit + _DOUBT]
        if not similar:
            return np.zeros((3, 3))
        weights = np.array([math.exp((misfit - candidate.misfit) / _DOUBT) for candidate in similar])
        away = np.array([_difference(candidate.pose, state.pose) for candidate in similar])
        return np.asarray(np.einsum("b,bi,bj->ij", weights / weights.sum(), away, away))

    def _settled(self, middle: LookSet, state: FitState) -> "_Basin":
        """Continue a fit without the groups that turn out to be elsewhere."""
        state = PoseFit(middle, self._errors).refined(state, 3, (0.12, 0.06))
        moved = suspects(middle, state, self._errors)
        if moved:
            state = PoseFit(middle, self._errors, left_out=moved).refined(state, 3, (0.10, 0.06))
            moved |= suspects(middle, state, self._errors)
        return _Basin(state, _misfit(middle, state), moved)


@dataclass(frozen=True, slots=True)
class _Expected:
    """Where the robot is expected, and how far around it is searched."""

    pose: Pose
    number: int
    """Number of the starting position; 0 elsewhere."""
    reach: Reach = MARK_REACH
    drove: bool = False
    """The robot drove between the looks, and its pose at the last one is measured."""

    @property
    def method(self) -> PlacementMethod:
        """Data of a measurement from several looks."""
        return PlacementMethod.DRIVE if self.drove else PlacementMethod.TURN

    def holds(self, pose: Pose) -> bool:
        """Whether a fitted pose is within reach."""
        return self.reach.holds(pose, self.pose)


def _on_grid(value: float, step: float, least: float, most: float) -> float:
    """Return a value within limits, rounded up to a multiple of a step."""
    return step * math.ceil(min(max(value, least), most) / step - 1e-9)


@dataclass(frozen=True, slots=True)
class _Basin:
    """A candidate pose of the robot."""

    state: FitState
    misfit: float
    moved: frozenset[int]


def _misfit(sighting: LookSet, state: FitState) -> float:
    return misfit_of(sighting, [state.pose_of(look) for look in sighting.looks], state.scale)


def _apart(basins: Sequence[_Basin]) -> list[_Basin]:
    """Return the candidates, best first, without duplicates of a better one."""
    distinct: list[_Basin] = []
    for basin in sorted(basins, key=lambda basin: basin.misfit):
        if not any(near(basin.state.pose, other.state.pose, 0.2) for other in distinct):
            distinct.append(basin)
    return distinct


def _of_other_places(state: FitState, basins: Sequence[_Basin]) -> Floats:
    """Return the (3, 3) covariance of the pose from alternatives, weighted by their fit relative to the best."""
    weights = _weights(basins)
    away = np.array([_difference(basin.state.pose, state.pose) for basin in basins])
    away[0] = 0.0
    return np.asarray(np.einsum("b,bi,bj->ij", weights / weights.sum(), away, away))


def _weights(basins: "Sequence[_Basin]") -> Floats:
    """Return (B,) weights by fit relative to the best, which is first and has 1; 0 for those that do not count."""
    weights = np.array([math.exp((basins[0].misfit - basin.misfit) / _DOUBT) for basin in basins])
    return np.where(weights < _LEAST_WEIGHT, 0.0, weights)


def _difference(pose: Pose, other: Pose) -> tuple[float, float, float]:
    turned_rad = math.remainder(pose.heading_rad - other.heading_rad, math.tau)
    return (pose.x_m - other.x_m, pose.y_m - other.y_m, turned_rad)


def _with_camera_ahead(look: DepthLook, ahead_m: float) -> DepthLook:
    """Return a look whose camera is mounted farther ahead."""
    mount = {"mount_forward_m": look.camera.mount_forward_m + ahead_m}
    return replace(look, camera=look.camera.model_copy(update=mount))


def _from_the_first(looks: Sequence[DepthLook]) -> list[DepthLook]:
    """Return the looks with odometry relative to the first one and with unwrapped headings."""
    first = looks[0].odometry
    away = [look.odometry.relative_to(first) for look in looks]
    headings = np.unwrap([pose.heading_rad for pose in away])
    headings -= headings[0]
    return [
        replace(look, odometry=Pose(pose.x_m, pose.y_m, float(heading)))
        for look, pose, heading in zip(looks, away, headings, strict=True)
    ]


def _to_the_last(looks: Sequence[DepthLook]) -> list[DepthLook]:
    """Return the looks, newest first, with the steps of the odometry from each to the newest."""
    poses = [look.odometry for look in looks]
    steps = [later.relative_to(earlier) for earlier, later in itertools.pairwise(poses)]
    steps = [Pose(step.x_m, step.y_m, math.remainder(step.heading_rad, math.tau)) for step in steps]
    return [
        replace(look, odometry=look.odometry.relative_to(poses[-1]), steps=tuple(steps[number:]))
        for number, look in reversed(list(enumerate(looks)))
    ]


def _undetermined(covariance: Floats, pose: Pose) -> tuple[str, ...]:
    """Return the names of directions that are not determined."""
    names: list[str] = []
    values, axes = np.linalg.eigh(covariance[:2, :2])
    if math.sqrt(values[0]) > _UNDETERMINED_M:
        names += ["forward-back", "left-right"]
    elif math.sqrt(values[1]) > _UNDETERMINED_M:
        along_rad = math.atan2(axes[1, 1], axes[0, 1]) - pose.heading_rad
        slant = abs(math.remainder(along_rad, math.pi))
        across, ahead = slant > math.radians(67), slant < math.radians(23)
        names.append("left-right" if across else "forward-back" if ahead else "the position along one line")
    if math.sqrt(covariance[2, 2]) > _UNDETERMINED_RAD:
        names.append("heading")
    return tuple(names)
