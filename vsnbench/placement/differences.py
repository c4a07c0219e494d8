"""What in the room differs from the plan: objects that do not stand where the survey has them.

Two questions, two rules. A fit leaves out what might mislead it, on slight suspicion. A person is told what is not
where the plan says, and goes to look: only what is seen through more than it is seen, by pixels enough.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.placement.fit import ErrorModel, FitState
from vsnbench.placement.looks import Sighting, SmallLook
from vsnbench.placement.normal_equations import Floats
from vsnbench.simulator.renderer import eye_of

_SUSPECT_M, _SUSPECT_SHARE, _SUSPECT_PIXELS, _SUSPECT_STEPS = 0.12, 0.45, 25, 3.0
"""Left out is what is seen through by more than that in so large a share of its pixels, of so many at least, or what
stands so many standard deviations off."""
_AGREES_M, _AGREES_SHARE = 0.06, 0.02
"""A pixel agrees within this and this share of its depth, and is seen through beyond twice that."""
_TIMES, _LEAST_SHARE = 1.5, 0.0025
"""Gone is what is seen through in so many times as many pixels as agree, in that share of the picture at least."""


def suspects(sighting: Sighting, state: FitState, errors: ErrorModel) -> frozenset[int]:
    """Return the objects, by their numbers as groups of the twin, that a fit had better leave out."""
    twin = sighting.twin
    expected, through = np.zeros(twin.groups), np.zeros(twin.groups)
    for look in sighting.looks:
        seen = _Seen.of(sighting, look, state)
        expected += seen.count(np.ones(len(seen.group), np.bool_))
        through += seen.count(seen.beyond_m > _SUSPECT_M)
    off = np.hypot(*state.steps.T) > _SUSPECT_STEPS * errors.object_m
    away = (expected >= _SUSPECT_PIXELS) & (through > _SUSPECT_SHARE * expected)
    return frozenset(np.nonzero(twin.is_object & (away | off))[0].tolist())


def gone(sighting: Sighting, state: FitState) -> frozenset[int]:
    """Return the objects, by their numbers as groups of the twin, that are not where the survey has them.

    What stands behind something that came is not named: of that nothing is known. Neither do pixels count in which the
    building would be seen at about the same depth without the object.
    """
    twin, looks = sighting.twin, sighting.looks
    agrees, through = np.zeros(twin.groups), np.zeros(twin.groups)
    for look in looks:
        seen = _Seen.of(sighting, look, state)
        behind = twin.building.draw(eye_of(sighting.camera, state.pose_of(look)), look.pinhole)
        width_m = _AGREES_M + _AGREES_SHARE * seen.depth_m
        tells = behind.depth_m[seen.where] - seen.depth_m > 2 * width_m
        agrees += seen.count(tells & (np.abs(seen.beyond_m) <= width_m))
        through += seen.count(tells & (seen.beyond_m > 2 * width_m))
    enough = _LEAST_SHARE * looks[0].depth_m.size
    return frozenset(np.nonzero(twin.is_object & (through >= enough) & (through > _TIMES * agrees))[0].tolist())


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The N pixels of a look that have a depth, beside what they should show."""

    where: npt.NDArray[np.bool_]
    """(h, w) which they are."""
    group: npt.NDArray[np.int32]
    """(N,)."""
    depth_m: npt.NDArray[np.floating[Any]]
    """(N,) as it should be."""
    beyond_m: npt.NDArray[np.floating[Any]]
    """(N,) how much farther it is."""
    groups: int

    @classmethod
    def of(cls, sighting: Sighting, look: SmallLook, state: FitState) -> "_Seen":
        """Return those of a look."""
        twin, view = sighting.twin, sighting.expected(look, state.pose_of(look))
        where = (view.face >= 0) & np.isfinite(look.depth_m)
        depth_m = view.depth_m[where]
        beyond_m = look.depth_m[where] * state.scale - depth_m
        return cls(where, twin.group_of[view.face[where]], depth_m, beyond_m, twin.groups)

    def count(self, these: npt.NDArray[np.bool_]) -> Floats:
        """Return (G,) how many of some pixels should show each group."""
        return np.bincount(self.group[these], minlength=self.groups).astype(np.float64)
