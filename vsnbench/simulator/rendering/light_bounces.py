"""Light that surfaces reflect onto each other: what each point sees, and the sum of all bounces."""

from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.runtime.numba_cache import compiled
from vsnbench.simulator.rendering.light_rays import cast

BOUNCES = 4
"""Number of times that light is reflected."""
_FLOOR_CELL_M = 0.1
_OUTSIDE = (0.5, 0.52, 0.56)
"""RGB light from directions in which a ray leaves the building, for example through a window."""

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


def floor_plan(
    points: Floats, on_floor: npt.NDArray[np.bool_], bounds: tuple[float, float, float, float], elsewhere: int
) -> tuple[float, float, float, Indices]:
    """Return a map from the floor plan to the nearest point on the floor: origin, cell size and (rows, columns)."""
    x0, y0, x1, y1 = bounds
    columns, rows = int((x1 - x0) / _FLOOR_CELL_M) + 1, int((y1 - y0) / _FLOOR_CELL_M) + 1
    plan = np.full((rows, columns), elsewhere, np.int32)
    held = np.flatnonzero(on_floor)
    column = np.clip(((points[held, 0] - x0) / _FLOOR_CELL_M).astype(int), 0, columns - 1)
    row = np.clip(((points[held, 1] - y0) / _FLOOR_CELL_M).astype(int), 0, rows - 1)
    plan[row[::-1], column[::-1]] = held[::-1]
    return x0, y0, _FLOOR_CELL_M, plan


@compiled
def find_sources(  # noqa: PLR0913 - compiled functions take arrays, not objects
    points: Any,
    normals: Any,
    owners: Any,
    first: Any,
    lit: Any,
    world: Any,
    directions: Any,
    ceiling: Any,
    plan: Any,
    maps: Any,
    roof: Any,
    sources: Any,
) -> None:
    """Write which source of light every point sees in every direction into `sources` (N, D).

    A source is the index of a point, the number of points + the index of a primitive whose mean light is used, or -1
    outdoors. A point inside a solid has the mean of its own primitive. The first point has index `first` in `lit`,
    which is from `direct_light`. `directions` are cosine-weighted unit vectors on the hemisphere about z; `plan` is
    from `floor_plan`. `maps` are the faces of each primitive, the axes, place, size and start of each face's light map,
    and the point of each cell. `roof` is the primitive of the ceiling, or -1.
    """
    _, _, _, _, _, centres, rotations, half_sizes, shapes, _, _ = world
    plan_x, plan_y, plan_cell, floor_points = plan
    faces, axis_s, axis_t, place, size, start, copies = maps
    count = len(lit)
    stamps = np.zeros(len(centres) + 1, np.int64)
    for number in range(len(points)):
        lift = lit[first + number, 3]
        if lift == 0.0:
            for k in range(len(directions)):
                sources[number, k] = count + owners[number]
            continue
        normal = normals[number]
        px = points[number, 0] + lift * normal[0]
        py = points[number, 1] + lift * normal[1]
        pz = points[number, 2] + lift * normal[2]
        # Frame around the normal (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
        sign = 1.0 if normal[2] >= 0.0 else -1.0
        a = -1.0 / (sign + normal[2])
        b = normal[0] * normal[1] * a
        ux, uy, uz = 1.0 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0]
        vx, vy, vz = b, sign + normal[1] * normal[1] * a, -normal[1]
        for k in range(len(directions)):
            p, q, r = directions[k, 0], directions[k, 1], directions[k, 2]
            rx = p * ux + q * vx + r * normal[0]
            ry = p * uy + q * vy + r * normal[1]
            rz = p * uz + q * vz + r * normal[2]
            limit = 50.0
            if rz < -1e-6:  # a point at the floor's height sees the floor, not what is below it
                limit = min(limit, max(pz, 1e-3) / -rz)
            elif rz > 1e-6:
                limit = min(limit, max(ceiling - pz, 1e-3) / rz)
            at, thing = cast(px, py, pz, rx, ry, rz, limit, 0.0, owners[number], np.int64(0), world, stamps)
            if thing < 0:
                if at >= 50.0:
                    sources[number, k] = -1
                    continue
                x, y = px + at * rx, py + at * ry
                i, j = int((x - plan_x) / plan_cell), int((y - plan_y) / plan_cell)
                if x < plan_x or y < plan_y or i >= floor_points.shape[1] or j >= floor_points.shape[0]:
                    sources[number, k] = -1
                    continue
                if rz < 0.0:
                    sources[number, k] = floor_points[j, i]
                    continue
                if roof < 0:
                    sources[number, k] = -1
                    continue
                thing = roof
            source = count + thing
            if shapes[thing] == 0 and faces[thing, 1] - faces[thing, 0] == 6:
                # The face of a box, in the order of the mesh: +x, -x, +y, -y, +z, -z.
                x, y, z = px + at * rx, py + at * ry, pz + at * rz
                ox, oy, oz = x - centres[thing, 0], y - centres[thing, 1], z - centres[thing, 2]
                turned = rotations[thing]
                best, side = -1.0, 0
                for axis in range(3):
                    value = (turned[0, axis] * ox + turned[1, axis] * oy + turned[2, axis] * oz) / half_sizes[
                        thing, axis
                    ]
                    if abs(value) > best:
                        best, side = abs(value), 2 * axis + (1 if value < 0.0 else 0)
                face = faces[thing, 0] + side
                s = axis_s[face, 0] * x + axis_s[face, 1] * y + axis_s[face, 2] * z
                t = axis_t[face, 0] * x + axis_t[face, 1] * y + axis_t[face, 2] * z
                i = min(max(int(s * place[face, 0] + place[face, 1] + 0.5), 0), size[face, 0] - 1)
                j = min(max(int(t * place[face, 2] + place[face, 3] + 0.5), 0), size[face, 1] - 1)
                source = copies[start[face] + j * size[face, 0] + i]
                if lit[source, 3] == 0.0:
                    source = count + thing
            sources[number, k] = source


@compiled
def _gather(sources: Any, radiance: Any, total: Any) -> None:
    """Write the mean radiance of every point's sources into `total` (N, 3); the last row of `radiance` is outdoors."""
    outdoors = len(radiance) - 1
    for number in range(len(sources)):
        red = green = blue = 0.0
        for k in range(sources.shape[1]):
            source = sources[number, k]
            if source < 0:
                source = outdoors
            red += radiance[source, 0]
            green += radiance[source, 1]
            blue += radiance[source, 2]
        total[number, 0] = red / sources.shape[1]
        total[number, 1] = green / sources.shape[1]
        total[number, 2] = blue / sources.shape[1]


def reflected(
    direct: npt.NDArray[np.float32], sources: Indices, owners: Indices, albedo: Floats, glow: Floats
) -> Floats:
    """Return the (N, 3) light that reaches every point after up to `BOUNCES` reflections.

    Args:
        direct: (N, 4) light that comes from lamps and windows; the fourth value is 0 for points inside a solid.
        sources: (N, D) from `find_sources`.
        owners: (N,) primitive of each point.
        albedo: (P, 3) linear colour of the primitives.
        glow: (P,) light that they emit.
    """
    shown = direct[:, 3] != 0
    share = 1 / np.maximum(np.bincount(owners[shown], minlength=len(albedo)), 1)
    indirect = np.zeros((len(direct), 3))
    radiance = np.empty((len(direct) + len(albedo) + 1, 3))
    for _ in range(BOUNCES):
        for channel in range(3):
            own = direct[:, channel] + indirect[:, channel]
            mean = np.bincount(owners[shown], own[shown], len(albedo)) * share
            radiance[: len(direct), channel] = (own + glow[owners]) * albedo[owners, channel]
            radiance[len(direct) : -1, channel] = (mean + glow) * albedo[:, channel]
        radiance[-1] = _OUTSIDE
        _gather(sources, radiance, indirect)
    return indirect


@compiled
def smooth(start: Any, size: Any, shown: Any, light: Any, smoothed: Any) -> None:
    """Write the mean light (N, 3) of its neighbours that are `shown` (N,) to each cell of the given faces.

    It hides the pattern of the directions on wide, even surfaces.
    """
    for face in range(len(start)):
        wide, high, at = size[face, 0], size[face, 1], start[face]
        for t in range(high):
            for s in range(wide):
                for channel in range(3):
                    total = weight = 0.0
                    for j in range(max(t - 2, 0), min(t + 3, high)):
                        for i in range(max(s - 2, 0), min(s + 3, wide)):
                            if shown[at + j * wide + i]:
                                total += light[at + j * wide + i, channel]
                                weight += 1.0
                    if weight > 0.0:
                        smoothed[at + t * wide + s, channel] = total / weight
