"""Rooms with displaced corners keep their walls joined and their doors in the walls."""

import numpy as np

from benchmarks.support.placement_trials import with_corners_off
from vsnbench.sites.geometry.walls import walls_of
from vsnbench.sites.site import load_site

APARTMENT = load_site("apartment")


def test_corners_that_are_off_are_shared_and_doors_and_windows_stay_in_their_walls() -> None:
    room = with_corners_off(APARTMENT, 0.02, np.random.default_rng(3))

    def corners(walls: list) -> list[list[int]]:  # type: ignore[type-arg]
        ends = [end for wall in walls for end in (wall.start, wall.end)]
        return [[number for number, other in enumerate(ends) if other == end] for end in ends]

    assert corners(room.walls) == corners(APARTMENT.walls)
    off_m = [np.subtract(is_.start, was.start) for was, is_ in zip(APARTMENT.walls, room.walls, strict=True)]
    assert 0.005 < np.std(off_m) < 0.04
    for opening in (*room.doors, *room.windows):
        assert walls_of(room, opening.start, opening.end, 1e-6)
