"""Demonstrator that knows the floor plan, but only those goals that have been in view since the start.

The oracle goes straight to goals that are not visible from its position; a network that sees only images cannot learn
from it where to search. This demonstrator looks around, goes to the nearest place whose surroundings were not in view,
looks around there, and goes to an instance of the goal once it was in view. Its actions follow from what was seen.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from training.expert import UNREACHED, Lattice, guide_to_instance, guide_to_place
from vsnbench.protocol.free_space import RESOLUTION_M
from vsnbench.sites.geometry.walls import wall_shapes
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

_PITCH_M: Final = 0.4
"""Distance between patches of floor."""
_SIGHT_M: Final = 3.5
"""Maximum distance of a patch that counts as seen."""
_AROUND_M: Final = 2.0
"""Radius of the patches that a lookout covers."""
_ARRIVED_M: Final = 0.3
_LOOKED_AROUND: Final = 0.85
"""Minimum share of seen patches of a lookout before the robot leaves it."""
_KNOWN: Final = 0.6
"""Minimum share of seen patches of a lookout that the robot does not visit."""
_FEWEST_PATCHES: Final = 3
"""Minimum number of patches that a lookout adds."""

Bools = npt.NDArray[np.bool_]


class Survey:
    """Patches of a site's floor, their mutual visibility, and lookouts that together see all of them."""

    def __init__(self, lattice: Lattice, eye_height_m: float) -> None:
        """Prepare the patches for a site's lattice and a camera height, metres."""
        self._lattice = lattice
        space = lattice.space
        stride = round(_PITCH_M / RESOLUTION_M)
        rows, columns = np.nonzero(space.cells[stride // 2 :: stride, stride // 2 :: stride])
        self._rows, self._columns = rows * stride + stride // 2, columns * stride + stride // 2
        xs, ys = space.x_m[self._rows, self._columns], space.y_m[self._rows, self._columns]
        self._points = np.stack([xs, ys], axis=1)
        across, up = xs[None, :] - xs[:, None], ys[None, :] - ys[:, None]
        self.bearing_rad = np.arctan2(up, across)
        """(patches, patches) direction from the first to the second, site frame."""
        distance_m = np.hypot(across, up)
        self.in_sight = self._open_lines(distance_m)
        """(patches, patches) mutual visibility: no wall between, within the maximum distance."""
        self.around = self.in_sight & (distance_m <= _AROUND_M)
        """(patches, patches) which patches belong to the surroundings of a patch."""
        self.lookouts = self._spread()
        """Numbers of the patches that are lookouts."""
        self.guide_to_lookout = cache(
            lambda patch: guide_to_place(lattice, int(self._rows[patch]), int(self._columns[patch]), _ARRIVED_M)
        )
        things = space.site.objects
        self.guide_to_thing = cache(lambda number: guide_to_instance(lattice, things[number], eye_height_m))

    def __len__(self) -> int:
        return len(self._points)

    def patch_at(self, pose: Pose) -> int:
        """Return the number of the patch nearest to a pose."""
        return int(np.argmin(np.hypot(*(self._points - pose.position).T)))

    def _open_lines(self, distance_m: npt.NDArray[np.float64]) -> Bools:
        first, second = np.nonzero(np.triu(distance_m <= _SIGHT_M, k=1))
        walls = shapely.union_all(wall_shapes(self._lattice.space.site))
        shapely.prepare(walls)
        lines = shapely.linestrings(np.stack([self._points[first], self._points[second]], axis=1))
        is_open = ~shapely.intersects(walls, lines)
        sight = np.eye(len(distance_m), dtype=np.bool_)
        sight[first[is_open], second[is_open]] = True
        return np.asarray(sight | sight.T)

    def _spread(self) -> list[int]:
        """Return lookouts, each with the most patches that earlier ones do not cover."""
        space = self._lattice.space
        roomy = space.clearance_m[self._rows, self._columns] >= space.robot_radius_m + 0.05
        missing = np.ones(len(self), np.bool_)
        lookouts: list[int] = []
        while True:
            gain = (self.around & missing).sum(axis=1) * roomy
            best = int(np.argmax(gain)) if len(gain) else 0
            if not len(gain) or gain[best] < _FEWEST_PATCHES:
                return lookouts
            lookouts.append(best)
            missing &= ~self.around[best]


@dataclass(slots=True)
class Search:
    """Search of one episode: what was in view so far, and the next action."""

    survey: Survey
    instances: frozenset[int]
    """The goal's instances as indices into the site's objects."""
    half_view_rad: float
    seen: Bools = field(init=False)
    found: set[int] = field(default_factory=set)
    _looking: bool = True
    _target: int | None = None
    _visited: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.seen = np.zeros(len(self.survey), np.bool_)

    def look(self, pose: Pose, in_view: Iterable[int]) -> None:
        """Record the visible patches and the objects that the image shows well enough."""
        here = self.survey.patch_at(pose)
        off = np.abs(np.angle(np.exp(1j * (self.survey.bearing_rad[here] - pose.heading_rad))))
        ahead = off <= self.half_view_rad
        ahead[here] = True
        self.seen |= self.survey.in_sight[here] & ahead
        self.found |= self.instances.intersection(in_view)

    def action_at(self, pose: Pose) -> Action | None:
        """Return the next action, after `look`; None without a path."""
        action = self._approach(pose, self.found)
        if action is None and self.found != self.instances:
            action = self._explore(pose)
            if action is None:  # all patches were seen, so the goal is occluded: use the plan
                self.found = set(self.instances)
                action = self._approach(pose, self.found)
        return action

    def _approach(self, pose: Pose, instances: Iterable[int]) -> Action | None:
        guides = [self.survey.guide_to_thing(number) for number in sorted(instances)]
        nearest = min(guides, key=lambda guide: guide.ticks_from(pose), default=None)
        return None if nearest is None else nearest.action_at(pose)

    def _explore(self, pose: Pose) -> Action | None:
        survey = self.survey
        if self._looking:
            if self._seen_around(survey.patch_at(pose)) < _LOOKED_AROUND:
                return Action.TURN_LEFT
            self._looking = False
        if self._target is None or self._seen_around(self._target) >= _LOOKED_AROUND:
            self._target = self._next_lookout(pose)
        if self._target is None:
            return None
        action = survey.guide_to_lookout(self._target).action_at(pose)
        if action is not Action.STOP:
            return action
        self._visited.add(self._target)
        self._looking, self._target = True, None
        return Action.TURN_LEFT

    def _next_lookout(self, pose: Pose) -> int | None:
        open_ones = [
            patch for patch in self.survey.lookouts if patch not in self._visited and self._seen_around(patch) < _KNOWN
        ]
        ticks = {patch: self.survey.guide_to_lookout(patch).ticks_from(pose) for patch in open_ones}
        nearest = min(ticks, key=lambda patch: ticks[patch], default=None)
        return None if nearest is None or ticks[nearest] >= UNREACHED else nearest

    def _seen_around(self, patch: int) -> float:
        around = self.survey.around[patch]
        return float(self.seen[around].mean())
