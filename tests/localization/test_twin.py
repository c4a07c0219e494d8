"""Survey errors are shared by an object's faces, and by a wall, its skirting and door frames."""

import numpy as np

from vsnbench.localization.twin import Twin
from vsnbench.sites.site import load_site

APARTMENT = load_site("apartment")
TWIN = Twin(APARTMENT)


def test_both_sides_of_a_wall_and_what_is_on_it_are_one_group() -> None:
    inner = next(wall for wall in APARTMENT.walls if wall.start == (6.4, 3.9) and wall.end == (10.0, 3.9))
    ahead = (np.abs(TWIN.normals[:, 1]) > 0.99) & (TWIN.object_of == 0)
    near_m = np.abs(TWIN.drawer.mesh.corners[:, 0, 1] - inner.start[1])
    groups = set(TWIN.group_of[ahead & (near_m < inner.thickness_m)].tolist())
    assert len(groups) == 1
    assert {-1, 1} == set(np.rint(TWIN.normals[TWIN.group_of == groups.pop(), 1]))


def test_walls_apart_err_apart_and_so_do_objects() -> None:
    walls = [TWIN.group_of[_face(axis, at_m)] for axis, at_m in ((0, 0.0), (0, 6.35), (1, 0.0), (1, 7.5))]
    assert len(set(walls)) == len(walls)
    assert TWIN.is_object[: len(APARTMENT.objects)].all()
    assert not TWIN.is_object[len(APARTMENT.objects) :].any()


def test_the_floor_and_nothing_else_is_the_floor() -> None:
    (floor,) = np.nonzero(TWIN.is_floor)[0]
    heights_m = TWIN.drawer.mesh.corners[TWIN.group_of == floor][:, :, 2]
    assert np.abs(heights_m).max() < 0.03


def _face(axis: int, at_m: float) -> int:
    """Return the largest face of the building on a plane perpendicular to an axis."""
    corners = TWIN.drawer.mesh.corners
    there = (np.abs(TWIN.normals[:, axis]) > 0.99) & (TWIN.object_of == 0)
    there &= np.abs(corners[:, 0, axis] - at_m) < 0.03
    span_m = np.linalg.norm(corners[:, 2] - corners[:, 0], axis=1)
    return int(np.argmax(np.where(there, span_m, 0.0)))


def test_nothing_below_the_ceiling_is_there_that_no_survey_has() -> None:
    """A real room has no lights where the simulator puts them, and each facet of a light would count as a wall."""
    ceiling_m = APARTMENT.ceiling_height_m
    heights_m = TWIN.drawer.mesh.corners[TWIN.object_of == 0][:, :, 2]
    hanging = (heights_m > ceiling_m - 0.06) & (heights_m < ceiling_m - 0.001)
    assert not hanging.all(axis=1).any()
