"""Plants, lamps, rugs and pictures."""

import math

from vsnbench.simulator.furniture.canvas import Canvas, multiply, recolored, rgb, turn
from vsnbench.simulator.primitives import Material, Shape, Vector

_GREENS = ("#3f7d35", "#4f9140", "#2f6a30", "#64a04a")


def plant(c: Canvas) -> None:
    """A pot of earth with a rubber plant, a palm or a rosette of blades, at least 0.8 of the box high."""
    reach = min(c.depth, c.width) / 2
    pot = min(0.32 * c.height, 0.42)
    wide = min(0.62 * reach, 0.55 * pot + 0.03)
    clay = c.paint("#b5633f", "plain", 0.1)
    c.cylinder(0, 0, (0, 0.86 * pot), 0.93 * wide, clay, 0.75)
    c.cylinder(0, 0, (0.8 * pot, pot), wide, recolored(clay, 1.06), 0.96)
    c.cylinder(0, 0, (pot, pot + 0.004), 0.86 * wide, Material(rgb("#3a2a1e"), "carpet"))
    (_rubber_plant, _palm, _rosette)[c.seed % 3](c, reach, pot)


def _leaf(c: Canvas, foot: Vector, around: float, lean: float, length: float, slim: float, number: int) -> Vector:
    """Add a leaf from its foot; return its tip."""
    out, up = length * math.cos(lean), length * math.sin(lean)
    way = (out * math.cos(around), out * math.sin(around), up)
    middle = (foot[0] + way[0] / 2, foot[1] + way[1] / 2, foot[2] + way[2] / 2)
    green = Material(rgb(_GREENS[number % len(_GREENS)]), "leaf", 0.25)
    rotation = multiply(turn((0, 0, 1), around), turn((0, 1, 0), -lean))
    c.place(Shape.LEAF, middle, (length / 2, slim * length / 2, 0.06 * length), green, rotation)
    return (foot[0] + way[0], foot[1] + way[1], foot[2] + way[2])


def _rubber_plant(c: Canvas, reach: float, pot: float) -> None:
    """A stem with broad leaves in whorls."""
    crown = c.height - pot
    c.cylinder(0, 0, (pot, pot + 0.75 * crown), max(0.008, 0.035 * reach), Material(rgb("#6a5334"), "wood"))
    whorls = max(3, round(crown / 0.13))
    for k in range(whorls):
        share = (k + 0.5) / whorls
        leaves = 6 if share < 0.75 else 4
        for j in range(leaves):
            around = math.tau * (j / leaves + 0.37 * k) + 0.3 * math.sin(5.0 * j + k)
            lean = 0.15 + 0.8 * share + 0.25 * math.sin(3.0 * j + 2.0 * k)
            length = reach * (1.0 - 0.25 * share) * (0.92 + 0.1 * math.sin(7.0 * j + k))
            _leaf(c, (0, 0, pot + crown * (0.1 + 0.6 * share)), around, lean, length, 0.5, 3 * k + j)
    for j in range(3):
        _leaf(c, (0, 0, c.height - 0.3 * crown), 2.1 * j + 0.4, 1.3, 0.3 * crown, 0.4, j)


def _palm(c: Canvas, reach: float, pot: float) -> None:
    """Fronds that rise from the pot and bend outwards, with long leaflets."""
    crown = c.height - pot
    stem = Material(rgb("#5c7a36"), "plain")
    for k in range(9):
        around, low = 2.4 * k, k % 3
        tip = (reach * (0.35 + 0.12 * low), crown * (0.98 - 0.2 * low))
        knee = (0.3 * tip[0], pot + 0.55 * tip[1], around)
        at = (tip[0] * math.cos(around), tip[0] * math.sin(around), pot + tip[1] * 0.9)
        middle = (knee[0] * math.cos(around), knee[0] * math.sin(around), knee[1])
        c.beam((0, 0, pot), middle, 0.012, stem)
        c.beam(middle, at, 0.009, stem)
        for j in range(5):
            share = (j + 0.6) / 5
            foot = (
                middle[0] + share * (at[0] - middle[0]),
                middle[1] + share * (at[1] - middle[1]),
                middle[2] + share * (at[2] - middle[2]),
            )
            side = 0.9 if j % 2 else -0.9
            length = 0.62 * reach * (1.1 - 0.3 * share)
            _leaf(c, foot, around + (side if j < 4 else 0.0), 0.3 - 0.4 * share, length, 0.22, k + j)


def _rosette(c: Canvas, reach: float, pot: float) -> None:
    """Long blades that rise from the pot and bend outwards."""
    crown = c.height - pot
    for k in range(24):
        around, high = 2.39996 * k, 0.55 + 0.45 * ((7 * k) % 24) / 24
        foot = (0.15 * reach * math.cos(around), 0.15 * reach * math.sin(around), pot)
        lean = 1.1 + 0.3 * math.sin(3.0 * k)
        tip = _leaf(c, foot, around, lean, 0.75 * high * crown, 0.16, k)
        bent = (
            foot[0] + 0.7 * (tip[0] - foot[0]),
            foot[1] + 0.7 * (tip[1] - foot[1]),
            foot[2] + 0.7 * (tip[2] - foot[2]),
        )
        _leaf(c, bent, around, lean - 0.75, 0.42 * high * crown, 0.26, k + 1)


def floor_lamp(c: Canvas) -> None:
    """A heavy foot, a thin pole, a wide shade."""
    _lamp(c, pole=0.012, shade_height=0.2, foot=0.68)


def table_lamp(c: Canvas) -> None:
    """A round body under a broad shade."""
    reach = min(c.depth, c.width) / 2
    body = Material(rgb("#5f7f8c"), "plain", 0.5)
    c.ellipsoid((0, 0, 0.28 * c.height), (0.5 * reach, 0.5 * reach, 0.26 * c.height), body)
    _lamp(c, pole=0.01, shade_height=0.42, foot=0.6)


def _lamp(c: Canvas, pole: float, shade_height: float, foot: float) -> None:
    reach = min(c.depth, c.width) / 2
    metal = Material(rgb("#2d2c2b"), "metal", 0.5)
    c.cylinder(0, 0, (0, min(0.025, 0.06 * c.height)), foot * reach, metal)
    low = (1 - shade_height) * c.height
    c.cylinder(0, 0, (0.01, low + 0.3 * shade_height * c.height), pole, metal)
    rings = 14
    for k in range(rings):
        step = shade_height * c.height / rings
        radius = reach * (1.0 - 0.3 * k / rings)
        c.cylinder(0, 0, (low + k * step, low + (k + 1) * step), radius, c.paint("#f0dca8", "cloth", 0.0, 0.75))


def rug(c: Canvas) -> None:
    """A woven field inside a border."""
    cloth = c.paint("#b9a27a", "carpet")
    border = min(0.12, 0.12 * min(c.depth, c.width))
    c.box((c.back, c.front), (c.right, c.left), (0, 0.7 * c.height), recolored(cloth, 0.6))
    c.box(
        (c.back + border, c.front - border),
        (c.right + border, c.left - border),
        (0, 0.9 * c.height),
        Material(cloth.color, "rug"),
    )
    line = border * 0.3
    far = border * 0.4
    for y in (c.right + far, c.left - far - line):
        c.box((c.back + far, c.front - far), (y, y + line), (0, c.height), recolored(cloth, 0.95))
    for x in (c.back + far, c.front - far - line):
        c.box((x, x + line), (c.right + far, c.left - far), (0, 0.98 * c.height), recolored(cloth, 0.95))


def picture(c: Canvas) -> None:
    """A frame around a mount around a painting."""
    frame = c.paint("#3b2a1d", "wood", 0.3)
    edge = min(0.035, 0.1 * min(c.width, c.height))
    c.box((c.back, c.front - 0.3 * c.depth), (c.right, c.left), (0, c.height), Material(rgb("#f0ede4")))
    for y in ((c.right, c.right + edge), (c.left - edge, c.left)):
        c.box((c.back, c.front), y, (0, c.height), frame)
    for z in ((0.0, edge), (c.height - edge, c.height)):
        c.box((c.back, c.front), (c.right + edge, c.left - edge), z, frame)
    mount = edge + 0.1 * min(c.width, c.height)
    c.box(
        (c.front - 0.3 * c.depth, c.front - 0.28 * c.depth),
        (c.right + mount, c.left - mount),
        (mount, c.height - mount),
        Material(rgb("#ffffff"), "painting"),
    )
