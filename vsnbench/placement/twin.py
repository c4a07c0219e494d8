"""What a site's twin says of surfaces: what is drawn where, on which plane each face lies, and which of them err alike.

A survey errs by the object and by the wall: all faces of an object are off by the same step on the floor, all faces of
a wall by the same distance across it, at one end perhaps more than at the other.
"""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.site import Site
from vsnbench.simulator.depth_view import DepthDrawer
from vsnbench.simulator.mesh import Mesh, build_mesh
from vsnbench.simulator.scene import build_scene

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]

_UPRIGHT = 0.5
"""A plane whose normal rises less than this stands."""
_PLANE_STEP_M, _WAY_RAD = 0.05, np.pi / 60
"""Planes of the building that agree to this are one."""
_WALL_M = 0.20
"""No wall with all that is on it reaches farther from its largest plane."""
_SIDE = (np.cos(0.3), np.sin(0.3))
"""No wall is thought to run along this, or its sides would be taken for each other's."""
_SHORTEST_M = 0.10


class Twin:
    """A site as its twin draws it; not to be used by two threads at once."""

    def __init__(self, site: Site) -> None:
        self.site = site
        mesh = build_mesh(build_scene(site))
        self.drawer = DepthDrawer(mesh)
        self.normals: Floats = mesh.normals
        """(F, 3) outward."""
        self.plane_m: Floats = np.einsum("fi,fi->f", mesh.normals, mesh.corners[:, 0])
        """(F,) distance of each face's plane from the origin along its normal."""
        self.object_of: Ints = mesh.instances[mesh.owner]
        """(F,) 1 + index into the site's objects; 0 for the building."""
        self.group_of, self.groups = _groups(mesh, self.object_of)
        """(F,) which faces err alike, and how many such groups there are; an object's is its number less 1."""
        self.is_object: Bools = np.arange(self.groups) < int(self.object_of.max(initial=0))
        """(G,)."""
        self.is_floor: Bools = np.zeros(self.groups, np.bool_)
        """(G,)."""
        on_floor = (self.object_of == 0) & (mesh.normals[:, 2] > _UPRIGHT) & (np.abs(self.plane_m) < _PLANE_STEP_M)
        self.is_floor[self.group_of[on_floor]] = True
        self.middle, self.half_length_m = _walls(mesh, self.group_of, self.groups, self.is_object)
        """(G, 2) and (G,) of each wall on the floor plan, metres; whatever is no wall has no end."""

    @cached_property
    def building(self) -> DepthDrawer:
        """Draws the same without what stands in it."""
        return DepthDrawer(build_mesh(build_scene(self.site.model_copy(update={"objects": []}))))


_MOST_TWINS = 4
_twins: dict[str, Twin] = {}


def twin_of(site: Site) -> Twin:
    """Return a site's twin; the last few are kept."""
    if site.sha256 not in _twins:
        while len(_twins) >= _MOST_TWINS:
            del _twins[next(iter(_twins))]
        _twins[site.sha256] = Twin(site)
    return _twins[site.sha256]


def _groups(mesh: Mesh, object_of: Ints) -> tuple[Ints, int]:
    """Return (F,) each face's group, and their number: objects first, then walls, then what lies."""
    objects = int(object_of.max(initial=0))
    group_of = (object_of - 1).astype(np.int32)
    building = np.nonzero(object_of == 0)[0]
    upright = building[np.abs(mesh.normals[building, 2]) < _UPRIGHT]
    level = building[np.abs(mesh.normals[building, 2]) >= _UPRIGHT]
    group_of[upright], walls = _walls_of(mesh, upright)
    height_m = np.rint(mesh.corners[level, 0, 2] / _PLANE_STEP_M)
    heights, which = np.unique(height_m, return_inverse=True)
    group_of[upright] += objects
    group_of[level] = objects + walls + which.reshape(-1)
    return group_of, objects + walls + len(heights)


def _walls_of(mesh: Mesh, faces: npt.NDArray[np.intp]) -> tuple[Ints, int]:
    """Return (N,) which of some upright faces belong to one wall, and how many walls there are.

    Both sides of a wall, its skirting and the frames of its doors are off the survey together: whatever is parallel and
    within `_WALL_M` of the largest plane. What they say of a pose counts once.
    """
    way = np.mod(np.arctan2(mesh.normals[faces, 1], mesh.normals[faces, 0]), np.pi)
    way = np.rint(way / _WAY_RAD) % round(np.pi / _WAY_RAD)
    place_m = np.einsum("ni,ni->n", outward(mesh.normals[faces]), mesh.corners[faces, 0, :2])
    side, other = (mesh.corners[faces, k] - mesh.corners[faces, 0] for k in (1, 2))
    area = np.linalg.norm(np.cross(side, other), axis=1)
    keys, which = np.unique(np.column_stack([way, np.rint(place_m / _PLANE_STEP_M)]), axis=0, return_inverse=True)
    which = which.reshape(-1)
    wall_of = np.full(len(keys), -1, np.int32)
    seeds: list[npt.NDArray[np.float64]] = []
    for plane in np.argsort(-np.bincount(which, area)):
        near = (
            number
            for number, seed in enumerate(seeds)
            if seed[0] == keys[plane, 0] and abs(seed[1] - keys[plane, 1]) * _PLANE_STEP_M <= _WALL_M
        )
        wall_of[plane] = next(near, len(seeds))
        if wall_of[plane] == len(seeds):
            seeds.append(keys[plane])
    return wall_of[which], len(seeds)


def outward(normals: Floats) -> Floats:
    """Return (N, 2) normals on the floor plan, all of parallel faces to the same side."""
    flat = normals[:, :2]
    return np.asarray(flat * np.where(flat @ np.array(_SIDE) < 0, -1.0, 1.0)[:, None])


def _walls(mesh: Mesh, group_of: Ints, groups: int, is_object: Bools) -> tuple[Floats, Floats]:
    upright = (np.abs(mesh.normals[:, 2]) < _UPRIGHT) & ~is_object[group_of]
    normal = np.zeros((groups, 2))
    normal[group_of[upright]] = outward(mesh.normals[upright])
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    group = np.repeat(group_of[upright], 4)
    corners = mesh.corners[upright, :, :2].reshape(-1, 2)
    reach_m = (along[group] * corners).sum(axis=1)
    least_m, most_m = np.full(groups, np.inf), np.full(groups, -np.inf)
    np.minimum.at(least_m, group, reach_m)
    np.maximum.at(most_m, group, reach_m)
    is_wall = np.isfinite(least_m)
    least_m, most_m = np.where(is_wall, least_m, 0.0), np.where(is_wall, most_m, 0.0)
    middle_m = (least_m + most_m) / 2
    half_m = np.where(is_wall, np.maximum(most_m - least_m, 2 * _SHORTEST_M) / 2, np.inf)
    return along * middle_m[:, None], half_m
