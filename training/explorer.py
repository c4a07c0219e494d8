"""The demonstrator: it knows the floor plan, but of the goals only those that have been in view since the start.

The oracle walks straight to goals that nobody could see from where it stands; a network that sees only images cannot
learn from it where to look. This one looks around, walks to the nearest place whose surroundings were not in view yet,
looks around there, and goes for an instance of the goal once it was in view: all of it can be told from what was seen.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from training.expert import UNREACHED, Lattice, guide_to_instance, guide_to_place
from vsnbench.protocol.actions import Action
from vsnbench.protocol.free_space import RESOLUTION_M
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.walls import wall_shapes

_PITCH_M: Final = 0.4
"""Between the patches of floor that are counted as seen or not."""
_SIGHT_M: Final = 3.5
"""Patches farther off do not count as seen."""
_AROUND_M: Final = 2.0
"""A lookout is for the patches in sight within this distance."""
_ARRIVED_M: Final = 0.3
_LOOKED_AROUND: Final = 0.85
"""Share of a lookout's patches that have to be seen before its place is left."""
_KNOWN: Final = 0.6
"""A lookout of whose patches at least this share was seen is not walked to."""
_FEWEST_PATCHES: Final = 3
"""A lookout that adds fewer patches than this is not worth one."""

Bools = npt.NDArray[np.bool_]


class Survey:
    """The floor of a twin in patches, which patch is in sight of which, and the lookouts that together see them all."""

    def __init__(self, lattice: Lattice, eye_height_m: float) -> None:
        """Take the twin's lattice and the height of the camera, metres."""
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
        """(patches, patches) within sight of each other: no wall between, not too far."""
        self.around = self.in_sight & (distance_m <= _AROUND_M)
        """(patches, patches) what one has to look at to have looked around at a patch."""
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
        """Return lookouts such that each covers the most patches that those before it do not."""
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
    """One episode's search: what was in view so far, and what the demonstrator does next."""

    survey: Survey
    instances: frozenset[int]
    """The goal's instances: places in the site's list of objects."""
    half_view_rad: float
    seen: Bools = field(init=False)
    found: set[int] = field(default_factory=set)
    _looking: bool = True
    _target: int | None = None
    _visited: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.seen = np.zeros(len(self.survey), np.bool_)

    def look(self, pose: Pose, in_view: Iterable[int]) -> None:
        """Take note of what is in view: the patches ahead, and the things that a picture shows well enough."""
        here = self.survey.patch_at(pose)
        off = np.abs(np.angle(np.exp(1j * (self.survey.bearing_rad[here] - pose.heading_rad))))
        ahead = off <= self.half_view_rad
        ahead[here] = True
        self.seen |= self.survey.in_sight[here] & ahead
        self.found |= self.instances.intersection(in_view)

    def action_at(self, pose: Pose) -> Action | None:
        """Return what the demonstrator does there, after `look`; None where it knows no way."""
        action = self._approach(pose, self.found)
        if action is None and self.found != self.instances:
            action = self._explore(pose)
            if action is None:  # everything was looked at: it must be hidden, and from here on the plan is used
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
