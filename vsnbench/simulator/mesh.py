"""The visible primitives of a scene as convex polygons in flat arrays: what the rasteriser's kernels read."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.categories import CATEGORIES
from vsnbench.simulator.furniture.canvas import rotation_matrix
from vsnbench.simulator.primitives import Primitive, Scene, Shape
from vsnbench.simulator.textures import TEXTURES, Mapping

SEMANTIC_CLASSES: tuple[str, ...] = ("", "wall", "floor", "ceiling", "door", "window", *sorted(CATEGORIES))
"""Names of the semantic ids in an image; id 0 is nothing."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]


def semantic_id(category: str) -> int:
    """Return the id under which a category appears in semantic images."""
    return SEMANTIC_CLASSES.index(category)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """P primitives, V vertices, F convex faces of three or four corners; world frame, metres.

    A face's plane carries two axes: `axis_s` and `axis_t`. Texture and light are looked up by the coordinates
    (s, t) = (axis_s . p, axis_t . p) of a point p of the face.
    """

    vertices: Floats
    """(V, 3)."""
    corners: Ints
    """(F, 4) indices of vertices, counter-clockwise from outside; a triangle repeats its last."""
    normals: Floats
    """(F, 3) outward."""
    axis_s: Floats
    axis_t: Floats
    """(F, 3) unit."""
    extent: Floats
    """(F, 4): smallest and largest s, smallest and largest t."""
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
    """(P,) of the ball around each primitive."""
    faces: Ints
    """(P, 2) first face and one past the last."""
    colors: Floats
    """(P, 3) linear albedo."""
    shininess: Floats
    glow: Floats
    """(P,)."""
    categories: npt.NDArray[np.uint8]
    instances: Ints
    """(P,)."""


def linear(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return an sRGB colour as linear light."""
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return (red, green, blue)


Polygon = list[tuple[float, float, float]]


def _box_faces(half: tuple[float, float, float]) -> list[Polygon]:
    x, y, z = half
    return [
        [(x, -y, -z), (x, y, -z), (x, y, z), (x, -y, z)],
        [(-x, y, -z), (-x, -y, -z), (-x, -y, z), (-x, y, z)],
        [(x, y, -z), (-x, y, -z), (-x, y, z), (x, y, z)],
        [(-x, -y, -z), (x, -y, -z), (x, -y, z), (-x, -y, z)],
        [(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)],
        [(-x, y, -z), (x, y, -z), (x, -y, -z), (-x, -y, -z)],
    ]


def _segments(radius: float) -> int:
    return 8 if radius < 0.025 else 12 if radius < 0.06 else 20 if radius < 0.2 else 28


def _cylinder_faces(half: tuple[float, float, float]) -> list[Polygon]:
    radius, _, z = half
    count = _segments(radius)
    # Between the inscribed and the circumscribed polygon, so that the error has no sign.
    reach = radius * (1 + 1 / math.cos(math.pi / count)) / 2
    ring = [(reach * math.cos(math.tau * k / count), reach * math.sin(math.tau * k / count)) for k in range(count)]
    faces: list[Polygon] = []
    for k in range(count):
        (x0, y0), (x1, y1) = ring[k], ring[(k + 1) % count]
        faces.append([(x0, y0, -z), (x1, y1, -z), (x1, y1, z), (x0, y0, z)])
    for side in (1, -1):
        rim = ring if side > 0 else ring[::-1]
        # Caps are cut into quads that share the first corner.
        for k in range(1, count - 1, 2):
            last = min(k + 2, count - 1)
            faces.append([(*rim[i], side * z) for i in (0, k, k + 1, last)])
    return faces


def _ellipsoid_faces(half: tuple[float, float, float]) -> list[Polygon]:
    around = 8 if max(half) < 0.04 else 12 if max(half) < 0.16 else 20
    rows = around // 2
    grow = (1 + 1 / math.cos(math.pi / around)) / 2
    a, b, c = (value * grow for value in half)

    def point(k: int, row: int) -> tuple[float, float, float]:
        angle, polar = math.tau * (k % around) / around, math.pi * row / rows
        return (
            a * math.sin(polar) * math.cos(angle),
            b * math.sin(polar) * math.sin(angle),
            c * math.cos(polar),
        )

    faces: list[Polygon] = []
    for row in range(rows):
        for k in range(around):
            top_left, top_right = point(k, row), point(k + 1, row)
            low_left, low_right = point(k, row + 1), point(k + 1, row + 1)
            if row == 0:
                faces.append([top_left, low_left, low_right])
            elif row == rows - 1:
                faces.append([top_left, low_left, top_right])
            else:
                # A quad of a sphere's grid is flat; stretching keeps it so.
                faces.append([top_left, low_left, low_right, top_right])
    return faces


_FACES = {Shape.BOX: _box_faces, Shape.CYLINDER: _cylinder_faces, Shape.ELLIPSOID: _ellipsoid_faces}
_SHAPE_IDS = {Shape.BOX: 0, Shape.CYLINDER: 1, Shape.ELLIPSOID: 2}
_BUILDING = ("wall", "floor", "ceiling")


def _axes(
    primitive: Primitive, rotation: Floats, corners: Floats, normal: Floats, mapping: Mapping
) -> tuple[Floats, Floats]:
    """Choose the axes of a face: level for the building and for pictures, along the grain for everything else."""
    up = np.array([0.0, 0.0, 1.0])
    if primitive.shape is Shape.ELLIPSOID:
        helper = rotation[:, 0] if abs(rotation[:, 0] @ normal) < 0.8 else rotation[:, 1]
        t = np.cross(normal, helper)
        t /= np.linalg.norm(t)
        return np.cross(t, normal), t
    if primitive.category in ("floor", "ceiling") and abs(normal[2]) > 0.5:
        return np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    first, second = corners[1] - corners[0], corners[-1] - corners[0]
    if primitive.shape is Shape.CYLINDER and len(corners) == 4 and abs(normal @ rotation[:, 2]) > 0.5:
        return rotation[:, 0].copy(), rotation[:, 1].copy()
    s = first / np.linalg.norm(first)
    t = second / np.linalg.norm(second)
    level = mapping is not Mapping.GRAIN or primitive.category in _BUILDING
    if level:
        if abs(normal @ up) < 0.9 and abs(s @ up) > abs(t @ up):
            s, t = t, s
        if t @ up < -1e-9:
            t = -t
        return s, t
    return (t, s) if np.linalg.norm(second) > np.linalg.norm(first) else (s, t)


def build_mesh(scene: Scene) -> Mesh:
    """Return the visible primitives of a scene as polygons."""
    shown = [primitive for primitive in scene.primitives if primitive.visible]
    names = list(TEXTURES)
    vertices: list[tuple[float, float, float]] = []
    corners: list[list[int]] = []
    normals, axis_s, axis_t, extent, texture, texture_map, owner = [], [], [], [], [], [], []
    faces: list[tuple[int, int]] = []
    rotations = [np.array(rotation_matrix(primitive.rotation)) for primitive in shown]
    for index, (primitive, rotation) in enumerate(zip(shown, rotations, strict=True)):
        first_face = len(corners)
        style = TEXTURES[primitive.material.texture]
        centre = np.array(primitive.centre)
        for polygon in _FACES[primitive.shape](primitive.half_size):
            points = np.array(polygon) @ rotation.T + centre
            normal = np.cross(points[1] - points[0], points[2] - points[0])
            length = float(np.linalg.norm(normal))
            if length < 1e-14:
                continue
            normal /= length
            s, t = _axes(primitive, rotation, points, normal, style.mapping)
            at = len(vertices)
            vertices.extend(map(tuple, points))
            numbers = list(range(at, at + len(points)))
            corners.append(numbers + [numbers[-1]] * (4 - len(numbers)))
            along, across = points @ s, points @ t
            box = (along.min(), along.max(), across.min(), across.max())
            normals.append(normal)
            axis_s.append(s)
            axis_t.append(t)
            extent.append(box)
            texture.append(names.index(primitive.material.texture))
            owner.append(index)
            if style.mapping is Mapping.FIT:
                wide, high = max(box[1] - box[0], 1e-9), max(box[3] - box[2], 1e-9)
                texture_map.append((1 / wide, -box[0] / wide, 1 / high, -box[2] / high))
            else:
                away = 0.0 if primitive.category in _BUILDING else 0.6180339887 * index
                u, v = 1 / style.size_m[0], 1 / style.size_m[1]
                texture_map.append((u, away % 1.0, v, 1.7 * away % 1.0))
        faces.append((first_face, len(corners)))
    half_sizes = np.array([primitive.half_size for primitive in shown])
    radii = np.array(
        [
            max(primitive.half_size) if primitive.shape is Shape.ELLIPSOID else math.hypot(*primitive.half_size)
            for primitive in shown
        ]
    )
    return Mesh(
        vertices=np.array(vertices),
        corners=np.array(corners, np.int32),
        normals=np.array(normals),
        axis_s=np.array(axis_s),
        axis_t=np.array(axis_t),
        extent=np.array(extent),
        texture=np.array(texture, np.int32),
        texture_map=np.array(texture_map),
        owner=np.array(owner, np.int32),
        centres=np.array([primitive.centre for primitive in shown]),
        rotations=np.array(rotations),
        half_sizes=half_sizes,
        shapes=np.array([_SHAPE_IDS[primitive.shape] for primitive in shown], np.int32),
        radii=radii * 1.05,
        faces=np.array(faces, np.int32),
        colors=np.array([linear(primitive.material.color) for primitive in shown]),
        shininess=np.array([primitive.material.shininess for primitive in shown]),
        glow=np.array([primitive.material.glow for primitive in shown]),
        categories=np.array([semantic_id(primitive.category) for primitive in shown], np.uint8),
        instances=np.array([primitive.instance for primitive in shown], np.int32),
    )
