"""What a site's twin says of surfaces: what is drawn where, on which plane each face lies, and which of them err alike.

A survey errs by the object and by the wall: all faces of an object are off by the same step on the floor, all faces on
one plane of the building by the same distance along its normal.
"""

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.site import Site
from vsnbench.simulator.depth_view import DepthDrawer
from vsnbench.simulator.mesh import Mesh, build_mesh
from vsnbench.simulator.scene import build_scene

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

_UPRIGHT = 0.5
"""A plane whose normal rises less than this stands."""
_PLANE_STEP_M, _NORMAL_STEP = 0.05, 0.05
"""Planes of the building that agree to this are one."""


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
