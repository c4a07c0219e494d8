"""From depth images to a measured placement: search, fit, doubt, and what in the room differs from the plan."""

import math
import time
from collections.abc import Sequence

import numpy as np

from vsnbench.placement.fit import ErrorModel, FitState, refine
from vsnbench.placement.looks import DepthLook, SmallLook
from vsnbench.placement.search import candidates, misfit_of, near
from vsnbench.placement.twin import Twin, twin_of
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.simulator.renderer import eye_of

_COARSE_PX, _MIDDLE_PX, _FINE_PX = 40, 80, 160
_BASINS = 5
_UNDETERMINED_M, _UNDETERMINED_RAD = 0.10, math.radians(4.0)
"""A direction whose standard deviation is larger is not determined by the view."""
_MISFIT_LIMIT = 0.55
_AS_GOOD = 0.04
_GONE_M, _GONE_SHARE, _LEAST_PIXELS = 0.12, 0.45, 25


class PlacementMatcher:
    """Measures where a robot with this camera stands in this site; one thread at a time."""

    def __init__(self, site: Site, camera: Camera, errors: ErrorModel | None = None) -> None:
        self._twin: Twin = twin_of(site)
        self._site = site
        self._camera = camera
        self._errors = errors or ErrorModel()

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
        twin, camera = self._twin, self._camera
        first = looks[0].odometry
        placed = [DepthLook(look.depth_m, look.odometry.relative_to(first)) for look in looks]
        small = {
            width: [SmallLook.of(look, camera, width) for look in placed]
            for width in (_COARSE_PX, _MIDDLE_PX, _FINE_PX)
        }
        found = candidates(twin, camera, small[_COARSE_PX], start.pose, _BASINS)
        fitted: list[tuple[FitState, float]] = []
        for one in found:
            state = refine(twin, camera, small[_MIDDLE_PX], one.pose, self._errors, 6, (0.20, 0.06))
            fitted.append((state, misfit_of(twin, camera, small[_MIDDLE_PX], state.pose)))
        fitted.sort(key=lambda each: each[1])
        best, misfit = fitted[0]
        moved = self._moved(small[_MIDDLE_PX], best)
        left_out = frozenset(moved)
        best = refine(twin, camera, small[_FINE_PX], best.pose, self._errors, 5, (0.06, 0.04), left_out, best)
        ambiguous = any(
            other < misfit + _AS_GOOD * max(misfit, 0.1) and not near(state.pose, best.pose)
            for state, other in fitted[1:]
        )
        self.last_state, self.last_fitted = best, fitted
        now = best.pose_of(small[_FINE_PX][-1])
        return MeasuredPlacement(
            start=start.number,
            mark=start.pose,
            pose=now,
            covariance=PoseCovariance.of(best.covariance),
            tolerance=tolerance or PlacementTolerance(),
            method=PlacementMethod.LOOK if len(looks) == 1 else PlacementMethod.TURN,
            looks=len(looks),
            fits=misfit < _MISFIT_LIMIT,
            undetermined=_undetermined(best.covariance, now),
            ambiguous=ambiguous,
            moved=tuple(self._site.objects[group].id for group in sorted(moved)),
            depth_scale=best.scale,
            took_s=time.perf_counter() - began_s,
        )

    def _moved(self, looks: Sequence[SmallLook], state: FitState) -> set[int]:
        """Return the groups of objects that do not stand where the survey says."""
        twin, camera = self._twin, self._camera
        expected = np.zeros(twin.groups)
        through = np.zeros(twin.groups)
        for look in looks:
            view = twin.drawer.draw(eye_of(camera, state.pose_of(look)), look.pinhole)
            shown = (view.face >= 0) & np.isfinite(look.depth_m)
            face, beyond_m = view.face[shown], look.depth_m[shown] * state.scale - view.depth_m[shown]
            group = twin.group_of[face]
            kept = twin.object_of[face] > 0
            expected += np.bincount(group[kept], minlength=twin.groups)
            through += np.bincount(group[kept & (beyond_m > _GONE_M)], minlength=twin.groups)
        with np.errstate(invalid="ignore", divide="ignore"):
            gone = (expected >= _LEAST_PIXELS) & (through / expected > _GONE_SHARE)
        off = np.hypot(*state.steps.T) > 3.0 * self._errors.object_m
        off[np.arange(twin.groups) >= len(self._site.objects)] = False
        return set(np.nonzero(gone | off)[0].tolist())


def _undetermined(covariance: np.ndarray, pose: Pose) -> tuple[str, ...]:
    """Return in words which directions are not determined."""
    words: list[str] = []
    values, axes = np.linalg.eigh(covariance[:2, :2])
    if math.sqrt(values[0]) > _UNDETERMINED_M:
        words += ["forward-back", "left-right"]
    elif math.sqrt(values[1]) > _UNDETERMINED_M:
        along_rad = math.atan2(axes[1, 1], axes[0, 1]) - pose.heading_rad
        slant = abs(math.remainder(along_rad, math.pi))
        words.append(
            "left-right"
            if slant > math.radians(67)
            else "forward-back"
            if slant < math.radians(23)
            else "the place along one line"
        )
    if math.sqrt(covariance[2, 2]) > _UNDETERMINED_RAD:
        words.append("heading")
    return tuple(words)
