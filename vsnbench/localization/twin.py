"""Twin of a site for matching: its views, the plane of each face, and the faces that share a survey error.

Surveys have one error per object and per wall: all faces of an object have the same offset on the floor, all faces of a
wall the same offset along its normal, possibly different at its two ends.
"""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.rendering.mesh import Mesh, build_mesh
from vsnbench.simulator.rendering.renderer import DepthDrawer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]

_UPRIGHT = 0.5
"""Maximum vertical component of the normal of an upright plane."""
_PLANE_STEP_M, _WAY_RAD = 0.05, np.pi / 60
"""Planes of the building that agree within this are one."""
_WALL_M = 0.20
"""Maximum distance of a wall's faces from its largest plane."""
_SIDE = (np.cos(0.3), np.sin(0.3))
"""Reference direction that orients parallel normals; no wall is assumed to run along it."""
_SHORTEST_M = 0.10


class Twin:
    """A site's twin; not thread-safe."""

    def __init__(self, site: Site) -> None:
        self.site = site
        mesh = build_mesh(build_scene(site, is_surveyed_only=True))
        self.drawer = DepthDrawer(mesh)
        self.normals: Floats = mesh.normals
        """(F, 3) outward normals."""
        self.plane_m: Floats = np.einsum("fi,fi->f", mesh.normals, mesh.corners[:, 0])
        """(F,) distance of each face's plane from the origin along its normal."""
        self.object_of: Ints = mesh.instances[mesh.owner]
        """(F,) 1 + index of the site's object; 0 for the building."""
        self.group_of, self.groups = _groups(mesh, self.object_of)
        """(F,) group of faces with a common error, and number of groups; an object's group is its number minus 1."""
        self.is_object: Bools = np.arange(self.groups) < int(self.object_of.max(initial=0))
        """(G,)."""
        self.is_floor: Bools = np.zeros(self.groups, np.bool_)
        """(G,)."""
        on_floor = (self.object_of == 0) & (mesh.normals[:, 2] > _UPRIGHT) & (np.abs(self.plane_m) < _PLANE_STEP_M)
        self.is_floor[self.group_of[on_floor]] = True
        self.middle, self.half_length_m = _walls(mesh, self.group_of, self.groups, self.is_object)
        """(G, 2) centre and (G,) half length of each wall on the floor plan, metres; infinite half length for other
        groups.
        """

    @cached_property
    def building(self) -> DepthDrawer:
        """Twin without the site's objects."""
        return DepthDrawer(build_mesh(build_scene(self.site.model_copy(update={"objects": []}))))


_MOST_TWINS = 4
_twins: dict[str, Twin] = {}


def twin_of(site: Site) -> Twin:
    """Return a site's twin, cached."""
    if site.sha256 not in _twins:
        while len(_twins) >= _MOST_TWINS:
            del _twins[next(iter(_twins))]
        _twins[site.sha256] = Twin(site)
    return _twins[site.sha256]


def _groups(mesh: Mesh, object_of: Ints) -> tuple[Ints, int]:
    """Return (F,) group of each face, and the number of groups: objects first, then walls, then horizontal faces."""
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
    """Return (N,) wall of each upright face, and the number of walls.

    Both sides of a wall, its skirting and the frames of its doors share a survey error: all faces that are parallel to
    the largest plane and within `_WALL_M` of it. They count once.
    """
    way = np.mod(np.arctan2(mesh.normals[faces, 1], mesh.normals[faces, 0]), np.pi)
    way = np.rint(way / _WAY_RAD) % round(np.pi / _WAY_RAD)
    place_m = np.einsum("ni,ni->n", outward(mesh.normals[faces]), mesh.corners[faces, 0, :2])
    side, other = (mesh.corners[faces, k] - mesh.corners[faces, 0] for k in (1, 2))
    area = np.linalg.norm(np.cross(side, other), axis=1)
    keys, which = np.unique(np.column_stack([way, np.rint(place_m / _PLANE_STEP_M)]), axis=0, return_inverse=True)
    which = which.reshape(-1)
    wall_of = np.full(len(keys), -1, np.int32)
    seeds: list[Floats] = []
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
    """Return (N, 2) normals on the floor plan, with parallel faces on the same side."""
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
