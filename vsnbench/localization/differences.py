"""Differences between room and plan: objects that are not where the survey has them.

There are two rules. A fit excludes objects on slight suspicion, since they may bias it. A report to the operator needs
more evidence: more pixels behind the object's surveyed surface than on it, and enough of them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.localization.fit import ErrorModel, FitState
from vsnbench.localization.looks import LookSet, SmallLook
from vsnbench.localization.normal_equations import Floats
from vsnbench.simulator.rendering.renderer import eye_of

_SUSPECT_M, _SUSPECT_SHARE, _SUSPECT_PIXELS, _SUSPECT_STEPS = 0.12, 0.45, 25, 3.0
"""An object is excluded if more than this share of its pixels, and at least this number, are behind it, or if it is
this number of standard deviations away from its place.
"""
_AGREES_M, _AGREES_SHARE = 0.06, 0.02
"""A pixel agrees within this absolute and this relative depth difference, and is behind beyond twice that."""
_TIMES, _LEAST_SHARE = 1.5, 0.0025
"""An object is gone if this many times as many pixels are behind it as agree, and at least this share of the image."""


def suspects(sighting: LookSet, state: FitState, errors: ErrorModel) -> frozenset[int]:
    """Return the objects, as group numbers of the twin, that a fit should exclude."""
    twin = sighting.twin
    expected, through = np.zeros(twin.groups), np.zeros(twin.groups)
    for look in sighting.looks:
        seen = _Seen.of(sighting, look, state)
        expected += seen.count(np.ones(len(seen.group), np.bool_))
        through += seen.count(seen.beyond_m > _SUSPECT_M)
    off = np.hypot(*state.steps.T) > _SUSPECT_STEPS * errors.object_m
    away = (expected >= _SUSPECT_PIXELS) & (through > _SUSPECT_SHARE * expected)
    return frozenset(np.nonzero(twin.is_object & (away | off))[0].tolist())


def gone(sighting: LookSet, state: FitState) -> frozenset[int]:
    """Return the objects, as group numbers of the twin, that are not where the survey has them.

    Objects behind an unknown obstacle are not reported, since they are not visible. Pixels do not count if the building
    behind the object has about the same depth.
    """
    twin, looks = sighting.twin, sighting.looks
    agrees, through = np.zeros(twin.groups), np.zeros(twin.groups)
    for look in looks:
        seen = _Seen.of(sighting, look, state)
        behind = twin.building.draw(eye_of(look.camera, state.pose_of(look)), look.pinhole)
        width_m = _AGREES_M + _AGREES_SHARE * seen.depth_m
        tells = behind.depth_m[seen.where] - seen.depth_m > 2 * width_m
        agrees += seen.count(tells & (np.abs(seen.beyond_m) <= width_m))
        through += seen.count(tells & (seen.beyond_m > 2 * width_m))
    enough = _LEAST_SHARE * looks[0].depth_m.size
    return frozenset(np.nonzero(twin.is_object & (through >= enough) & (through > _TIMES * agrees))[0].tolist())


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The N pixels of a look that have depth, with the expected depth."""

    where: npt.NDArray[np.bool_]
    """(h, w) mask of these pixels."""
    group: npt.NDArray[np.int32]
    """(N,)."""
    depth_m: npt.NDArray[np.floating[Any]]
    """(N,) expected depth."""
    beyond_m: npt.NDArray[np.floating[Any]]
    """(N,) measured minus expected depth."""
    groups: int

    @classmethod
    def of(cls, sighting: LookSet, look: SmallLook, state: FitState) -> "_Seen":
        """Return the compared pixels of a look."""
        twin, view = sighting.twin, sighting.expected(look, state.pose_of(look))
        where = (view.face >= 0) & np.isfinite(look.depth_m)
        depth_m = view.depth_m[where]
        beyond_m = look.depth_m[where] * state.scale - depth_m
        return cls(where, twin.group_of[view.face[where]], depth_m, beyond_m, twin.groups)

    def count(self, these: npt.NDArray[np.bool_]) -> Floats:
        """Return (G,) numbers of the given pixels that should show each group."""
        return np.bincount(self.group[these], minlength=self.groups).astype(np.float64)
