"""Visible primitives of a scene as convex polygons in flat arrays for the rasterizer's kernels."""

import itertools
import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.furniture.canvas import rotation_matrix
from vsnbench.simulator.primitives import Primitive, Scene, Shape
from vsnbench.simulator.rendering.textures import SIZE, TEXTURES, Mapping

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """P primitives and their F convex faces with three or four corners; world frame, metres.

    A face's plane has two axes, `axis_s` and `axis_t`. Texture and light are read at the coordinates
    (s, t) = (axis_s . p, axis_t . p) of a point p of the face.
    """

    corners: Floats
    """(F, 4, 3) counter-clockwise from outside; a triangle repeats its last corner."""
    normals: Floats
    """(F, 3) outward normals."""
    axis_s: Floats
    axis_t: Floats
    """(F, 3) unit vectors."""
    extent: Floats
    """(F, 4) minimum and maximum s, minimum and maximum t."""
    texture: Ints
    """(F,) index into TEXTURES."""
    texture_map: Floats
    """(F, 4): texture coordinate = (s * [0] + [1], t * [2] + [3]), in tiles."""
    owner: Ints
    """(F,) index of the primitive."""
    centres: Floats
    """(P, 3)."""
    rotations: Floats
    """(P, 3, 3) local to world."""
    half_sizes: Floats
    """(P, 3)."""
    shapes: Ints
    """(P,) 0 box, 1 cylinder, 2 ellipsoid."""
    radii: Floats
    """(P,) radius of the bounding sphere of each primitive."""
    faces: Ints
    """(P, 2) first face and last face + 1."""
    colors: Floats
    """(P, 3) linear albedo."""
    shininess: Floats
    glow: Floats
    """(P,)."""
    instances: Ints
    """(P,)."""


def linear(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return an sRGB colour as linear light."""
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return (red, green, blue)


@cache
def _box_faces() -> Floats:
    """Return the (6, 4, 3) faces of the cube from -1 to 1."""
    return np.array(
        [
            [(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)],
            [(-1, 1, -1), (-1, -1, -1), (-1, -1, 1), (-1, 1, 1)],
            [(1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)],
            [(-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)],
            [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
            [(-1, 1, -1), (1, 1, -1), (1, -1, -1), (-1, -1, -1)],
        ],
        float,
    )


def _ring(count: int) -> list[tuple[float, float]]:
    """Return the corners of a polygon halfway between inscribed and circumscribed, so that its mean error is 0."""
    reach = (1 + 1 / math.cos(math.pi / count)) / 2
    return [(reach * math.cos(math.tau * k / count), reach * math.sin(math.tau * k / count)) for k in range(count)]


@cache
def _cylinder_faces(count: int) -> Floats:
    """Return the faces of a prism of `count` sides, radius and half length 1."""
    ring = _ring(count)
    faces = []
    for (x0, y0), (x1, y1) in itertools.pairwise([*ring, ring[0]]):
        faces.append([(x0, y0, -1), (x1, y1, -1), (x1, y1, 1), (x0, y0, 1)])
    for side in (1, -1):
        rim = ring if side > 0 else ring[::-1]
        # The caps' quads share the first corner.
        faces.extend([(*rim[i], side) for i in (0, k, k + 1, min(k + 2, count - 1))] for k in range(1, count - 1, 2))
    return np.array(faces, float)


@cache
def _ball_faces(count: int) -> Floats:
    """Return the faces of a sphere of radius 1 with `count` meridians; the quads of its grid are flat."""
    rows = count // 2
    grow = (1 + 1 / math.cos(math.pi / count)) / 2

    def point(k: int, row: int) -> tuple[float, float, float]:
        angle, polar = math.tau * (k % count) / count, math.pi * row / rows
        level = grow * math.sin(polar)
        return (level * math.cos(angle), level * math.sin(angle), grow * math.cos(polar))

    faces = []
    for row in range(rows):
        for k in range(count):
            upper, lower = (point(k, row), point(k + 1, row)), (point(k, row + 1), point(k + 1, row + 1))
            if row == 0:
                faces.append([upper[0], lower[0], lower[1], lower[1]])
            elif row == rows - 1:
                faces.append([upper[0], lower[0], upper[1], upper[1]])
            else:
                faces.append([upper[0], lower[0], lower[1], upper[1]])
    return np.array(faces)


def _beveled_faces(half_size: Floats, bevel_m: float) -> Floats:
    """Return the faces of a box whose edges and corners are cut off."""
    flat = _box_faces()
    inner = half_size - bevel_m
    sides = np.abs(flat).min(1) * np.abs(flat.sum(1)) / 4  # 1 along each face's normal
    faces = list(flat * (inner + bevel_m * sides[:, None]))

    def corner(signs: tuple[int, ...], axis: int) -> Floats:
        return np.asarray(np.array(signs) * (inner + bevel_m * (np.arange(3) == axis)))

    for axis, first, second in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        for a, b in itertools.product((-1, 1), repeat=2):
            low, high = ([0, 0, 0] for _ in range(2))
            low[axis], high[axis] = -1, 1
            low[first] = high[first] = a
            low[second] = high[second] = b
            edge = [corner(tuple(low), first), corner(tuple(low), second)]
            edge += [corner(tuple(high), second), corner(tuple(high), first)]
            faces.append(np.array(edge))
    for signs in itertools.product((-1, 1), repeat=3):
        tip = [corner(signs, axis) for axis in (0, 1, 2)]
        faces.append(np.array([*tip, tip[2]]))
    return _outwards(np.array(faces))


def _outwards(faces: Floats) -> Floats:
    """Return the faces of a convex shape around the origin with their corners counter-clockwise from outside."""
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    inwards = (normals * faces.mean(1)).sum(1) < 0
    faces[inwards] = faces[inwards][:, [0, 3, 2, 1]]
    return faces


def _leaf_faces() -> Floats:
    """Return a pointed lens of half sizes 1 along x, broadest before its middle, with a ridge on both sides."""
    broad, narrow = (-0.25, 0.95), (0.45, 0.62)
    faces = []
    for z in (1, -1):
        for y in (1, -1):
            ridge = [(-0.25, 0, z), (0.45, 0, 0.75 * z)]
            rim = [(broad[0], y * broad[1], 0), (narrow[0], y * narrow[1], 0)]
            side = [
                [(-1, 0, 0), ridge[0], rim[0], rim[0]],
                [ridge[0], ridge[1], rim[1], rim[0]],
                [ridge[1], (1, 0, 0), rim[1], rim[1]],
            ]
            faces += side
    return _outwards(np.array(faces, float))


def _faces_of(primitive: Primitive) -> Floats:
    """Return (n, 4, 3) faces in the primitive's own frame; small round shapes have few."""
    faces = _untapered(primitive)
    if primitive.taper != 1.0:
        low, high = min(1.0, primitive.taper), min(1.0, 1 / primitive.taper)
        share = (faces[..., 2:] / primitive.half_size[2] + 1) / 2
        faces = faces.copy()
        faces[..., :2] *= low + (high - low) * share
    return faces


def _untapered(primitive: Primitive) -> Floats:
    if primitive.shape is Shape.BOX:
        if primitive.bevel_m:
            return _beveled_faces(np.array(primitive.half_size), primitive.bevel_m)
        unit = _box_faces()
    elif primitive.shape is Shape.LEAF:
        unit = _leaf_faces()
    elif primitive.shape is Shape.CYLINDER:
        radius = primitive.half_size[0]
        unit = _cylinder_faces(8 if radius < 0.025 else 12 if radius < 0.06 else 20 if radius < 0.2 else 28)
    else:
        girth = sorted(primitive.half_size)[1]  # leaves are long, thin and numerous
        unit = _ball_faces(8 if girth < 0.06 else 12 if girth < 0.1 else 16 if girth < 0.15 else 28)
    return np.asarray(unit * np.array(primitive.half_size))


_DIGITS = 10
_SHAPE_IDS = {Shape.BOX: 0, Shape.CYLINDER: 1, Shape.ELLIPSOID: 2, Shape.LEAF: 2}
_BUILDING = ("wall", "floor", "ceiling")


def _axes(
    primitive: Primitive, rotation: Floats, corners: Floats, normals: Floats, mapping: Mapping
) -> tuple[Floats, Floats]:
    """Choose the axes (n, 3) of faces: horizontal for building and pictures, along the grain for other objects."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    if primitive.shape is Shape.ELLIPSOID or primitive.bevel_m:
        along = np.abs(normals @ rotation[:, 0]) < 0.8
        helper = np.where(along[:, None], rotation[:, 0], rotation[:, 1])
        t = _unit(np.cross(normals, helper))
        return np.cross(t, normals), t
    s, t = _unit(first), _unit(second)
    if primitive.shape is Shape.CYLINDER:
        caps = np.abs(normals @ rotation[:, 2]) > 0.5
        s[caps], t[caps] = rotation[:, 0], rotation[:, 1]
    if primitive.category in ("floor", "ceiling"):
        lying = np.abs(normals[:, 2]) > 0.5
        s[lying], t[lying] = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    if mapping is not Mapping.GRAIN or primitive.category in _BUILDING:
        swap = (np.abs(normals[:, 2]) < 0.9) & (np.abs(s[:, 2]) > np.abs(t[:, 2]))
        s[swap], t[swap] = t[swap], s[swap]
        t[t[:, 2] < -1e-9] *= -1
    else:
        swap = np.linalg.norm(second, axis=1) > np.linalg.norm(first, axis=1)
        s[swap], t[swap] = t[swap], s[swap]
    return s, t


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def build_mesh(scene: Scene) -> Mesh:
    """Return the visible primitives of a scene as polygons."""
    visible = [primitive for primitive in scene.primitives if primitive.visible]
    names = list(TEXTURES)
    parts: list[tuple[Floats, ...]] = []
    rotations = [np.array(rotation_matrix(primitive.rotation)) for primitive in visible]
    for index, (primitive, rotation) in enumerate(zip(visible, rotations, strict=True)):
        style = TEXTURES[primitive.material.texture]
        # Rounded, because products of matrices differ in the last bits between processors.
        corners = np.round(_faces_of(primitive) @ rotation.T + np.array(primitive.centre), _DIGITS)
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        has_area = np.linalg.norm(normals, axis=1) > 1e-14
        corners, normals = corners[has_area], np.round(_unit(normals[has_area]), _DIGITS)
        s, t = (np.round(axis, _DIGITS) for axis in _axes(primitive, rotation, corners, normals, style.mapping))
        along = np.round((corners @ s[:, :, None])[..., 0], _DIGITS)
        across = np.round((corners @ t[:, :, None])[..., 0], _DIGITS)
        extent = np.stack([along.min(1), along.max(1), across.min(1), across.max(1)], axis=1)
        if style.mapping is Mapping.FIT:
            wide, high = extent[:, 1] - extent[:, 0], extent[:, 3] - extent[:, 2]
            edge = 2 / SIZE  # keep opposite edges of a texture separate at all its sizes
            scale_s, scale_t = (1 - 2 * edge) / wide, (1 - 2 * edge) / high
            texture_map = np.stack(
                [scale_s, edge - extent[:, 0] * scale_s, scale_t, edge - extent[:, 2] * scale_t], axis=1
            )
        else:
            away = 0.0 if primitive.category in _BUILDING else 0.6180339887 * index
            row = (1 / style.size_m[0], away % 1.0, 1 / style.size_m[1], 1.7 * away % 1.0)
            texture_map = np.tile(np.array(row), (len(corners), 1))
        parts.append((corners, normals, s, t, extent, texture_map))
    corners, normals, s, t, extent, texture_map = map(np.concatenate, zip(*parts, strict=True))
    counts = [len(part[0]) for part in parts]
    owner = np.repeat(np.arange(len(visible), dtype=np.int32), counts)
    ends = np.cumsum(counts)
    radii = [
        max(primitive.half_size) if _SHAPE_IDS[primitive.shape] == 2 else math.hypot(*primitive.half_size)
        for primitive in visible
    ]
    textures = np.array([names.index(primitive.material.texture) for primitive in visible], np.int32)
    return Mesh(
        corners=corners,
        normals=normals,
        axis_s=s,
        axis_t=t,
        extent=extent,
        texture=textures[owner],
        texture_map=texture_map,
        owner=owner,
        centres=np.array([primitive.centre for primitive in visible]),
        rotations=np.array(rotations),
        half_sizes=np.array([primitive.half_size for primitive in visible]),
        shapes=np.array([_SHAPE_IDS[primitive.shape] for primitive in visible], np.int32),
        radii=np.array(radii) * 1.05,
        faces=np.stack([ends - counts, ends], axis=1).astype(np.int32),
        colors=np.array([linear(primitive.material.color) for primitive in visible]),
        shininess=np.array([primitive.material.shininess for primitive in visible]),
        glow=np.array([primitive.material.glow for primitive in visible]),
        instances=np.array([primitive.instance for primitive in visible], np.int32),
    )
