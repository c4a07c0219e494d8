"""Drawing surface of furniture models: the object's box in metres, with shapes and materials."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.random import Generator

from vsnbench.simulator.primitives import Material, Primitive, Quaternion, Shape, Vector

Span = tuple[float, float]
_Item = TypeVar("_Item")
UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)


def rgb(code: str) -> Vector:
    """Return `#rrggbb` as sRGB in [0, 1]."""
    return (int(code[1:3], 16) / 255, int(code[3:5], 16) / 255, int(code[5:7], 16) / 255)


def shade(color: Vector, factor: float) -> Vector:
    """Return a colour made darker (factor below 1) or lighter (above 1)."""
    red, green, blue = (min(1.0, channel * factor) for channel in color)
    return (red, green, blue)


def turn(axis: Vector, angle_rad: float) -> Quaternion:
    """Return the rotation by an angle about a unit axis."""
    sin = math.sin(angle_rad / 2)
    return (math.cos(angle_rad / 2), axis[0] * sin, axis[1] * sin, axis[2] * sin)


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation that applies `second`, then `first`."""
    a, b, c, d = first
    e, f, g, h = second
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def rotation_matrix(rotation: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation's matrix."""
    w, x, y, z = rotation
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def extents(shape: Shape, half_size: Vector, rotation: Quaternion) -> Vector:
    """Return the half sizes of the axis-aligned box around a rotated shape."""
    reach = []
    for row in rotation_matrix(rotation):
        along = [abs(part) * half for part, half in zip(row, half_size, strict=True)]
        if shape is Shape.BOX:
            reach.append(sum(along))
        elif shape is Shape.CYLINDER:
            reach.append(math.hypot(along[0], along[1]) + along[2])
        else:
            reach.append(math.hypot(*along))
    return (reach[0], reach[1], reach[2])


@dataclass(slots=True)
class Canvas:
    """Box of one object, and its parts in its own frame: x to its front, y to its left, z up from its base.

    Every part is clipped to the box, so that no part is outside the object's footprint.
    """

    depth: float
    width: float
    height: float
    color: Vector | None = None
    seed: int = 0
    """Selects among the variants of a model."""
    parts: list[Primitive] = field(default_factory=list)

    @property
    def random(self) -> Generator:
        """Random numbers that depend only on the seed."""
        return np.random.default_rng(self.seed)

    @property
    def back(self) -> float:
        """Smallest x."""
        return -self.depth / 2

    @property
    def front(self) -> float:
        """Largest x."""
        return self.depth / 2

    @property
    def right(self) -> float:
        """Smallest y."""
        return -self.width / 2

    @property
    def left(self) -> float:
        """Largest y."""
        return self.width / 2

    def paint(self, code: str, texture: str = "plain", shininess: float = 0.0, glow: float = 0.0) -> Material:
        """Return a material in the object's own colour, or in `code` if the site gives none."""
        return Material(self.color or rgb(code), texture, shininess, glow)

    def box(self, x: Span, y: Span, z: Span, material: Material, bevel_m: float = 0.0, *, solid: bool = True) -> None:
        """Add a box between the given edges."""
        edges = []
        for span, low, high in (
            (x, self.back, self.front),
            (y, self.right, self.left),
            (z, 0.0, self.height),
        ):
            start, end = max(low, min(span)), min(high, max(span))
            if end - start < 1e-4:
                return
            edges.append((start, end))
        self.parts.append(
            Primitive(
                Shape.BOX,
                _vector((start + end) / 2 for start, end in edges),
                _vector((end - start) / 2 for start, end in edges),
                material,
                bevel_m=min(bevel_m, *(0.4 * (end - start) for start, end in edges)),
                solid=solid,
            )
        )

    def cylinder(self, x: float, y: float, z: Span, radius: float, material: Material, taper: float = 1.0) -> None:
        """Add an upright cylinder, or a cone whose bottom is `taper` times as wide as its top."""
        half = (radius, radius, abs(z[1] - z[0]) / 2)
        self.place(Shape.CYLINDER, (x, y, sum(z) / 2), half, material, taper=taper)

    def rod(self, axis: str, centre: Vector, radius: float, length: float, material: Material) -> None:
        """Add a horizontal cylinder along `x` or `y`."""
        rotation = turn((0, 1, 0), math.pi / 2) if axis == "x" else turn((1, 0, 0), math.pi / 2)
        self.place(Shape.CYLINDER, centre, (radius, radius, length / 2), material, rotation)

    def ellipsoid(self, centre: Vector, half_size: Vector, material: Material) -> None:
        """Add an ellipsoid."""
        self.place(Shape.ELLIPSOID, centre, half_size, material)

    def beam(self, start: Vector, end: Vector, width: float, material: Material, *, round_: bool = True) -> None:
        """Add a straight bar between two points, round or square."""
        along = _vector(b - a for a, b in zip(start, end, strict=True))
        length = math.hypot(*along)
        lean = turn((0, 1, 0), math.acos(along[2] / length))
        rotation = multiply(turn((0, 0, 1), math.atan2(along[1], along[0])), lean)
        if not round_:  # sides parallel to the object's
            rotation = multiply(rotation, turn((0, 0, 1), -math.atan2(along[1], along[0])))
        middle = _vector((a + b) / 2 for a, b in zip(start, end, strict=True))
        shape = Shape.CYLINDER if round_ else Shape.BOX
        self.place(shape, middle, (width / 2, width / 2, length / 2), material, rotation)

    def place(
        self,
        shape: Shape,
        centre: Vector,
        half_size: Vector,
        material: Material,
        rotation: Quaternion = UPRIGHT,
        taper: float = 1.0,
        bevel_m: float = 0.0,
        *,
        solid: bool = True,
    ) -> None:
        """Add any shape, shrunk and moved to fit into the object's box."""
        room = (self.depth / 2, self.width / 2, self.height / 2)
        reach = extents(shape, half_size, rotation)
        scale = min(1.0, *(free / need for free, need in zip(room, reach, strict=True)))
        half = _vector(value * scale for value in half_size)
        if min(half) < 1e-4:
            return
        reach = extents(shape, half, rotation)
        middle = (0.0, 0.0, self.height / 2)
        clipped = _vector(
            axis + min(max(value - axis, need - free), free - need)
            for value, axis, free, need in zip(centre, middle, room, reach, strict=True)
        )
        bevel_m = min(bevel_m, 0.8 * min(half)) if shape is Shape.BOX else 0.0
        part = Primitive(shape, clipped, half, material, rotation, solid=solid, taper=taper, bevel_m=bevel_m)
        self.parts.append(part)

    def legs(self, inset: float, thickness: float, top: float, material: Material, round_: bool = False) -> None:
        """Add four legs from the floor to `top`, `inset` from the edges."""
        half = min(thickness, self.depth / 3, self.width / 3) / 2
        for x in (self.back + inset + half, self.front - inset - half):
            for y in (self.right + inset + half, self.left - inset - half):
                if round_:
                    self.cylinder(x, y, (0, top), half, material)
                else:
                    self.box((x - half, x + half), (y - half, y + half), (0, top), material)


def pick(random: Generator, items: Sequence[_Item]) -> _Item:
    """Return a random item."""
    return items[int(random.integers(len(items)))]


def recolored(material: Material, factor: float) -> Material:
    """Return a darker or lighter material."""
    return replace(material, color=shade(material.color, factor))


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = values
    return (x, y, z)
