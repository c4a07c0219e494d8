"""Plants, lamps, rugs and pictures."""

import math

from vsnbench.simulator.furniture.canvas import Canvas, multiply, recolored, rgb, turn
from vsnbench.simulator.primitives import Material, Shape

_GREENS = ("#3f7d35", "#4f9140", "#2f6a30", "#64a04a")


def plant(c: Canvas) -> None:
    """A pot of earth with a stem and leaves in whorls up to the top of the box."""
    reach = min(c.depth, c.width) / 2
    pot = min(0.32 * c.height, 0.42)
    wide = min(0.62 * reach, 0.55 * pot + 0.03)
    clay = c.paint("#b5633f", "plain", 0.1)
    c.cylinder(0, 0, (0, 0.88 * pot), 0.86 * wide, clay)
    c.cylinder(0, 0, (0.8 * pot, pot), wide, recolored(clay, 1.06))
    c.cylinder(0, 0, (pot, pot + 0.004), 0.86 * wide, Material(rgb("#3a2a1e"), "carpet"))
    top = c.height
    bark = Material(rgb("#6a5334"), "wood")
    crown = top - pot
    c.cylinder(0, 0, (pot, pot + 0.72 * crown), max(0.008, 0.035 * reach), bark)
    whorls = max(3, round(crown / 0.16))
    for k in range(whorls):
        share = (k + 0.5) / whorls
        leaves = 7 if share < 0.7 else 5
        length = reach * (0.98 - 0.35 * share) * 0.55
        lift = 0.25 + 0.75 * share
        for j in range(leaves):
            around = math.tau * (j / leaves + 0.37 * k) + 0.3 * math.sin(5.0 * j + k)
            lean = lift + 0.25 * math.sin(3.0 * j + 2.0 * k)
            rotation = multiply(turn((0, 0, 1), around), turn((0, 1, 0), -lean))
            out = length * math.cos(lean) + 0.02
            up = pot + crown * (0.12 + 0.62 * share) + length * math.sin(lean)
            green = Material(rgb(_GREENS[(3 * k + j) % len(_GREENS)]), "leaf", 0.25)
            c.place(
                Shape.ELLIPSOID,
                (out * math.cos(around), out * math.sin(around), up),
                (length, 0.36 * length, 0.035 * length + 0.002),
                green,
                rotation,
            )
    tip = 0.3 * crown
    for j in range(3):
        rotation = multiply(turn((0, 0, 1), 2.1 * j + 0.4), turn((0, 1, 0), -1.25))
        offset = 0.12 * tip
        c.place(
            Shape.ELLIPSOID,
            (offset * math.cos(2.1 * j + 0.4), offset * math.sin(2.1 * j + 0.4), top - tip / 2),
            (tip / 2, 0.3 * min(tip, reach), 0.004 + 0.02 * tip),
            Material(rgb(_GREENS[j]), "leaf", 0.25),
            rotation,
        )


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
