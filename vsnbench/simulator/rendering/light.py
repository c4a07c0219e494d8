"""Light on every face of a scene, computed once for all images.

Daylight and some sun come through the windows, lamps and ceiling lights add theirs, and surfaces reflect it onto each
other, so that corners and contacts are dark and colours bleed. The camera's exposure belongs to the site.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.files.disk_cache import cached_array, code_key, key_of
from vsnbench.simulator.furniture.canvas import extents, rotation_matrix
from vsnbench.simulator.primitives import Primitive, Scene, Shape
from vsnbench.simulator.rendering import mesh as mesh_module
from vsnbench.simulator.rendering import textures
from vsnbench.simulator.rendering.mesh import Floats, Mesh, linear
from vsnbench.simulator.rendering.textures import mean_colors

_CELL_M = {"floor": 0.05, "wall": 0.14, "ceiling": 0.2}
_FURNITURE_CELL_M = 0.09
_DIRECTIONS = (8, 48)
"""Minimum and maximum number of directions in which a point receives reflected light."""
_RAYS = 5_000_000
"""Number of rays that a scene with many surfaces shares among its points."""
_MANY_POINTS = 330_000
"""Number of points, twice the embedded apartment's, from which on fewer points of windows and lamps are sampled."""
_SUN = (0.36, -0.76, 0.54, 1.5, 1.36, 1.1)
"""Direction to the sun, not normalized, and its RGB light."""
_CEILING_LIGHT = (0.78, 0.72, 0.62)
_LAMP = (0.3, 0.24, 0.15)
_AMBIENT = (0.06, 0.058, 0.056)
"""Light that reaches every point, in place of more reflections."""
_EXPOSED = 0.62
"""Median light on walls that the camera's exposure aims at."""
_GRID_M = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class LightMaps:
    """A grid of light for each of F faces; its first and last cells are on the face's edges."""

    start: npt.NDArray[np.int64]
    """(F,) index of the first cell in `values`."""
    size: npt.NDArray[np.int32]
    """(F, 2) number of cells along s and t, at least two."""
    place: Floats
    """(F, 4) cell coordinate = (s * [0] + [1], t * [2] + [3])."""
    values: npt.NDArray[np.float32]
    """(N, 4) linear RGB and padding; 1 shows a surface in its own colour."""


def light_of(scene: Scene, mesh: Mesh) -> LightMaps:
    """Return the light of a scene, computed once and then cached on disk."""
    from vsnbench.simulator.rendering import light_bounces, light_rays

    visible = [primitive for primitive in scene.primitives if primitive.visible]
    size = _grid_sizes(mesh, visible)
    cells = size.prod(axis=1)
    start = np.cumsum(cells) - cells
    spans = np.maximum(mesh.extent[:, 1::2] - mesh.extent[:, ::2], 1e-9)
    scale = (size - 1) / spans
    place = np.stack([scale[:, 0], -mesh.extent[:, 0] * scale[:, 0], scale[:, 1], -mesh.extent[:, 2] * scale[:, 1]], 1)
    key = key_of(
        code_key(__file__, light_rays.__file__, light_bounces.__file__, mesh_module.__file__, textures.__file__), scene
    )
    values = cached_array(
        "light",
        key,
        np.float32,
        (int(cells.sum()), 4),
        lambda: _baked(scene, mesh, visible, size, start, place),
    )
    return LightMaps(start, size, place, values)


def _baked(
    scene: Scene,
    mesh: Mesh,
    visible: list[Primitive],
    size: npt.NDArray[np.int32],
    start: npt.NDArray[np.int64],
    place: Floats,
) -> npt.NDArray[np.float32]:
    """Compute the light of all cells, (N, 4). For `size`, `start` and `place`, see `LightMaps`."""
    from vsnbench.simulator.rendering import light_bounces
    from vsnbench.simulator.rendering.light_rays import direct_light, fill_buried

    points, normals, owners = _samples(mesh, size, start)
    length = math.hypot(*_SUN[:3])
    sun = np.array([*(part / length for part in _SUN[:3]), *_SUN[3:]])
    world, panes, lamps = _world(scene, mesh, visible), _panes(visible), _lamps(visible)
    # Facets of a round shape share corners: compute the light of each corner once.
    keys = np.round(np.column_stack([points, normals, owners]), 6)
    _, first, copies = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    copies = copies.reshape(-1)
    points, normals, owners = points[first], normals[first], owners[first]
    lit = np.empty((len(first), 4), np.float32)
    parts = _parts(3, 4, 2) if len(first) < _MANY_POINTS else _parts(2, 2, 1)
    _in_parts(
        lambda part: direct_light(
            points[part],
            normals[part],
            owners[part],
            world,
            panes,
            lamps,
            sun,
            parts,
            scene.ceiling_height_m,
            lit[part],
        ),
        len(first),
    )
    directions = _hemisphere(int(np.clip(_RAYS // len(first), *_DIRECTIONS)))
    category = np.array([primitive.category for primitive in visible])
    slabs = np.flatnonzero(category == "floor")
    roofs = np.flatnonzero((category == "ceiling") & (mesh.shapes == 0))
    on_floor = (category == "floor")[owners] & (normals[:, 2] > 0.5) & (mesh.half_sizes[owners, 2] < 0.02)
    plan = light_bounces.floor_plan(points, on_floor, scene.bounds, len(first) + int(slabs[0]) if len(slabs) else -1)
    sources = np.empty((len(first), len(directions)), np.int32)
    _in_parts(
        lambda part: light_bounces.find_sources(
            points[part],
            normals[part],
            owners[part],
            part.start,
            lit,
            world,
            directions,
            scene.ceiling_height_m,
            plan,
            (mesh.faces, mesh.axis_s, mesh.axis_t, place, size, start, copies),
            int(roofs[0]) if len(roofs) else -1,
            sources[part],
        ),
        len(first),
    )
    albedo = mesh.colors * mean_colors()[mesh.texture[mesh.faces[:, 0]]]
    indirect = light_bounces.reflected(lit, sources, owners, albedo, mesh.glow)
    walls = (lit[:, 3] != 0) & (category == "wall")[owners]
    factor = _exposure(lit[walls, :3] + indirect[walls] + np.array(_AMBIENT))
    values, reflected = lit[copies], indirect[copies]
    values[:, 3] = values[:, 3] != 0
    even = np.isin(category, ("wall", "ceiling"))[mesh.owner] & (size.min(1) > 2)
    smoothed = reflected.copy()
    light_bounces.smooth(start[even], size[even], values[:, 3] != 0, reflected, smoothed)
    values[:, :3] = (values[:, :3] + smoothed + np.array(_AMBIENT)) * factor
    fill_buried(start, size, values)
    return values


def _parts(across: int, up: int, of_lamp: int) -> tuple[Floats, Floats]:
    """Return the sampled points of a window (N, 2), in its half axes, and of a lamp (N, 2), in its radius."""
    step = 0.66 if across == 3 else 2 / across
    window = [((s - (across - 1) / 2) * step, (t - (up - 1) / 2) * 2 / up) for t in range(up) for s in range(across)]
    lamp = [(s - (of_lamp - 1) / 2, t - (of_lamp - 1) / 2) for t in range(of_lamp) for s in range(of_lamp)]
    return np.array(window), np.array(lamp)


def _exposure(walls: Floats) -> float:
    """Return the camera's exposure for the (N, 3) light on walls: dark sites stay darker, but less so."""
    level = float(np.median(walls.mean(axis=1))) if len(walls) else _EXPOSED
    return float((_EXPOSED / max(level, 0.05)) ** 0.7)


def _in_parts(work: Callable[[slice], None], count: int) -> None:
    """Call `work` with slices of `count` items on all processors."""
    workers = os.cpu_count() or 1
    step = max(1, -(-count // (4 * workers)))
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, [slice(k, min(k + step, count)) for k in range(0, count, step)]))


def _grid_sizes(mesh: Mesh, visible: list[Primitive]) -> npt.NDArray[np.int32]:
    """Return (F, 2) numbers of cells along s and t; facets of round shapes have only their four corners."""
    fine = np.array([_CELL_M.get(primitive.category, _FURNITURE_CELL_M) for primitive in visible])[mesh.owner]
    spans = mesh.extent[:, 1::2] - mesh.extent[:, ::2]
    count = np.ceil(spans / fine[:, None]).astype(np.int32) + 1
    category = np.array([primitive.category for primitive in visible])[mesh.owner]
    below = (category == "floor") & ((mesh.normals[:, 2] < 0.5) | (mesh.half_sizes[mesh.owner, 2] > 0.02))
    above = (category == "ceiling") & (mesh.normals[:, 2] > -0.5)
    count[below | above | (mesh.shapes[mesh.owner] != 0)] = 2
    return np.asarray(np.clip(count, 2, 256), np.int32)


def _samples(
    mesh: Mesh, size: npt.NDArray[np.int32], start: npt.NDArray[np.int64]
) -> tuple[Floats, Floats, npt.NDArray[np.int32]]:
    """Return the points where light is computed, with their normals and primitives."""
    face = np.repeat(np.arange(len(size)), size.prod(axis=1))
    within = np.arange(len(face)) - start[face]
    share_s = (within % size[face, 0]) / (size[face, 0] - 1)
    share_t = (within // size[face, 0]) / (size[face, 1] - 1)
    low_s, high_s, low_t, high_t = mesh.extent[face].T
    inset_s, inset_t = np.minimum(0.006, (high_s - low_s) / 5), np.minimum(0.006, (high_t - low_t) / 5)
    round_ = mesh.shapes[mesh.owner[face]] != 0
    inset_s[round_] = inset_t[round_] = 0
    s = low_s + inset_s + share_s * (high_s - low_s - 2 * inset_s)
    t = low_t + inset_t + share_t * (high_t - low_t - 2 * inset_t)
    corner = mesh.corners[:, 0]
    corner_s, corner_t = (corner * mesh.axis_s).sum(1), (corner * mesh.axis_t).sum(1)
    points = (
        corner[face]
        + (s - corner_s[face])[:, None] * mesh.axis_s[face]
        + (t - corner_t[face])[:, None] * mesh.axis_t[face]
    )
    normals = mesh.normals[face].copy()
    owners = mesh.owner[face]
    _round_off(mesh, points, normals, owners)
    return points, normals, owners


def _round_off(mesh: Mesh, points: Floats, normals: Floats, owners: npt.NDArray[np.int32]) -> None:
    """Replace the normals of points on round shapes by those of the smooth shape, so that facets are not visible."""
    local = np.einsum("nji,nj->ni", mesh.rotations[owners], points - mesh.centres[owners])
    half = mesh.half_sizes[owners]
    shape = mesh.shapes[owners]
    away = local / half**2
    side = (shape == 1) & (np.abs(np.einsum("nji,nj->ni", mesh.rotations[owners], normals)[:, 2]) < 0.5)
    away[side, 2] = 0
    bent = side | (shape == 2)
    length = np.linalg.norm(away, axis=1, keepdims=True)
    smooth = np.einsum("nij,nj->ni", mesh.rotations[owners], away / np.maximum(length, 1e-12))
    normals[bent] = smooth[bent]
    on_ball = shape == 2
    scale = 1 / np.maximum(np.linalg.norm(local / half, axis=1, keepdims=True), 1e-6)
    surface = mesh.centres[owners] + np.einsum("nij,nj->ni", mesh.rotations[owners], local * scale)
    points[on_ball] = surface[on_ball]


def _hemisphere(count: int) -> Floats:
    """Return (count, 3) unit vectors on the hemisphere about z with cosine-weighted density, in a spiral."""
    golden = math.pi * (3 - math.sqrt(5))
    radius = [math.sqrt((k + 0.5) / count) for k in range(count)]
    rows = [(r * math.cos(golden * k), r * math.sin(golden * k), math.sqrt(1 - r * r)) for k, r in enumerate(radius)]
    return np.round(np.array(rows), 9)


def _world(scene: Scene, mesh: Mesh, visible: list[Primitive]) -> tuple[object, ...]:
    """Sort the occluders into a grid over the floor plan."""
    x0, y0, x1, y1 = scene.bounds
    x0, y0 = x0 - _GRID_M, y0 - _GRID_M
    columns = math.ceil((x1 - x0) / _GRID_M) + 1
    rows = math.ceil((y1 - y0) / _GRID_M) + 1
    lists: list[list[int]] = [[] for _ in range(rows * columns)]
    for index, primitive in enumerate(visible):
        if primitive.category not in ("floor", "ceiling") and primitive.material.texture not in ("sky", "glass"):
            for cell in _cells_under(primitive, (x0, y0), (columns, rows)):
                lists[cell].append(index)
    items = np.array([index for held in lists for index in held] or [0], np.int32)
    ends = np.cumsum([0] + [len(held) for held in lists])
    table = np.stack([ends[row * columns : (row + 1) * columns + 1] for row in range(rows)]).astype(np.int32)
    return (
        x0,
        y0,
        _GRID_M,
        table,
        items,
        mesh.centres,
        mesh.rotations,
        mesh.half_sizes,
        mesh.shapes,
        mesh.radii,
        mesh.instances,
    )


def _cells_under(primitive: Primitive, origin: tuple[float, float], shape: tuple[int, int]) -> list[int]:
    reach = extents(primitive.shape, primitive.half_size, primitive.rotation)
    columns, rows = shape
    low = [int((primitive.centre[k] - reach[k] - origin[k]) // _GRID_M) for k in (0, 1)]
    high = [int((primitive.centre[k] + reach[k] - origin[k]) // _GRID_M) for k in (0, 1)]
    found = []
    turned = np.array(rotation_matrix(primitive.rotation))
    for row in range(max(0, low[1]), min(rows - 1, high[1]) + 1):
        for column in range(max(0, low[0]), min(columns - 1, high[0]) + 1):
            if primitive.shape is Shape.BOX and (high[0] - low[0]) * (high[1] - low[1]) > 8:
                # The bounding box of a slanted wall contains many cells that the wall does not touch.
                middle = np.array([origin[0] + (column + 0.5) * _GRID_M, origin[1] + (row + 0.5) * _GRID_M, 0.0])
                offset = turned.T @ (middle - np.array([*primitive.centre[:2], 0.0]))
                if np.any(np.abs(offset[:2]) > np.array(primitive.half_size[:2]) + 0.75 * _GRID_M):
                    continue
            found.append(row * columns + column)
    return found


def _panes(visible: list[Primitive]) -> Floats:
    """Return (W, 13) window panes: centre, half axes along and up, normal, area."""
    rows = []
    for primitive in visible:
        if primitive.material.texture == "sky":
            turned = np.array(rotation_matrix(primitive.rotation))
            along, _, up = primitive.half_size
            rows.append(
                [*primitive.centre, *(turned[:, 0] * along), *(turned[:, 2] * up), *turned[:, 1], 4 * along * up]
            )
    return np.array(rows).reshape(-1, 13)


def _lamps(visible: list[Primitive]) -> Floats:
    """Return (L, 8) lamps: position, RGB power, instance and radius; ceiling lights belong to the building."""
    rows = []
    for primitive in visible:
        if primitive.category == "ceiling" and primitive.material.glow > 0:
            x, y, z = primitive.centre
            rows.append([x, y, z - 0.1, *_CEILING_LIGHT, 0, 0.3])
    for instance in sorted({primitive.instance for primitive in visible if primitive.category == "lamp"}):
        bright = [p for p in visible if p.instance == instance and p.material.glow > 0]
        if bright:
            middle = np.mean([p.centre for p in bright], axis=0)
            red, green, blue = linear(bright[0].material.color)
            rows.append([*middle, _LAMP[0] * red * 1.2, _LAMP[1] * green * 1.3, _LAMP[2] * blue * 1.6, instance, 0.1])
    return np.array(rows).reshape(-1, 8)
