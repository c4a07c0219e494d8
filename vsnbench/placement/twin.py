"""What a site's twin says of surfaces: what is drawn where, on which plane each face lies, and which of them err alike.

A survey errs by the object and by the wall: all faces of an object are off by the same step on the floor, all faces on
one plane of the building by the same distance along its normal.
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
_PLANE_STEP_M, _NORMAL_STEP = 0.05, 0.05
"""Planes of the building that agree to this are one."""
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
        self.group_of, self.groups = _groups(mesh, self.object_of, self.plane_m)
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


def _groups(mesh: Mesh, object_of: Ints, plane_m: Floats) -> tuple[Ints, int]:
    objects = int(object_of.max(initial=0))
    group_of = (object_of - 1).astype(np.int32)
    building = np.nonzero(object_of == 0)[0]
    key = np.column_stack(
        [np.rint(mesh.normals[building] / _NORMAL_STEP), np.rint(plane_m[building] / _PLANE_STEP_M)]
    ).astype(np.int64)
    planes, which = np.unique(key, axis=0, return_inverse=True)
    group_of[building] = objects + which.reshape(-1)
    return group_of, objects + len(planes)


def _walls(mesh: Mesh, group_of: Ints, groups: int, is_object: Bools) -> tuple[Floats, Floats]:
    upright = (np.abs(mesh.normals[:, 2]) < _UPRIGHT) & ~is_object[group_of]
    normal = np.zeros((groups, 2))
    normal[group_of[upright]] = mesh.normals[upright, :2]
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
