"""Cabinets: sideboards, wardrobes, nightstands, shelves."""

from vsnbench.simulator.furniture.canvas import Canvas, Span, recolored, rgb
from vsnbench.simulator.primitives import Material

_STEEL = Material(rgb("#c2c5c9"), "metal", 0.6)
_BOOKS = ("#7f2f2c", "#2d4f6e", "#c9a24b", "#3f6b4a", "#d9d2c0", "#5b3b63", "#b5603a", "#26303a", "#8b9aa3")


def fronts(c: Canvas, y: Span, z: Span, columns: int, rows: int, front: Material, handle: str = "edge") -> None:
    """Add doors (one row, upright handles at the `edge`, or `low` on it) or drawers (`middle`) to a carcass."""
    gap, thick = 0.004, min(0.018, c.depth / 5)
    grip = c.front - 0.014
    face = grip - 0.002
    wide, high = (y[1] - y[0]) / columns, (z[1] - z[0]) / rows
    for column in range(columns):
        for row in range(rows):
            y0, z0 = y[0] + column * wide, z[0] + row * high
            c.box((face - thick, face), (y0 + gap, y0 + wide - gap), (z0 + gap, z0 + high - gap), front)
            if handle == "middle":
                c.box(
                    (face, c.front),
                    (y0 + wide / 2 - min(0.07, wide / 4), y0 + wide / 2 + min(0.07, wide / 4)),
                    (z0 + high * 0.7 - 0.006, z0 + high * 0.7 + 0.006),
                    _STEEL,
                )
            else:
                hinge_right = column % 2 == 0
                at = y0 + wide - 0.045 if hinge_right else y0 + 0.035
                share = 0.2 if handle == "low" else 0.5 if high > 1.2 else 0.78
                middle = z0 + high * share
                half = min(0.08, high / 5)
                c.box((face, c.front), (at, at + 0.012), (middle - half, middle + half), _STEEL)


def carcass(c: Canvas, z: Span, material: Material) -> None:
    """Add the closed body behind the fronts."""
    c.box((c.back, c.front - 0.02), (c.right, c.left), z, material)


def cabinet(c: Canvas) -> None:
    """A cabinet with doors below a top board."""
    wood = c.paint("#b98a5a", "wood", 0.2)
    plinth = min(0.07, 0.12 * c.height)
    c.box((c.back, c.front - 0.05), (c.right + 0.02, c.left - 0.02), (0, plinth), recolored(wood, 0.45))
    carcass(c, (plinth, c.height - 0.025), recolored(wood, 0.8))
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.025, c.height), wood)
    columns = max(1, round(c.width / 0.45))
    fronts(c, (c.right, c.left), (plinth, c.height - 0.025), columns, 1, wood)


def sideboard(c: Canvas) -> None:
    """A long low piece with drawers in the middle and doors on both sides, on feet."""
    wood = c.paint("#6f4a2d", "wood", 0.25)
    foot = min(0.1, 0.22 * c.height)
    c.legs(0.05, 0.04, foot, Material(rgb("#2b211a"), "wood"), round_=True)
    carcass(c, (foot, c.height - 0.025), recolored(wood, 0.75))
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.025, c.height), wood)
    third = c.width / 3
    z = (foot, c.height - 0.025)
    fronts(c, (c.right, c.right + third), z, 1, 1, wood)
    fronts(c, (c.right + third, c.left - third), z, 1, 2, wood, "middle")
    fronts(c, (c.left - third, c.left), z, 1, 1, wood)


def wall_cabinet(c: Canvas) -> None:
    """A kitchen cabinet on the wall."""
    body = Material(rgb("#e7e3da"), "plain", 0.15)
    carcass(c, (0, c.height), body)
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.02, c.height), body)
    c.box((c.back, c.front), (c.right, c.left), (0, 0.012), body)
    fronts(
        c,
        (c.right, c.left),
        (0.012, c.height - 0.02),
        max(1, round(c.width / 0.5)),
        1,
        c.paint("#b07f4c", "wood", 0.25),
        "low",
    )


def wardrobe(c: Canvas) -> None:
    """A tall cabinet with long doors; the middle one of three is a mirror."""
    wood = c.paint("#d9cbb2", "wood", 0.15)
    plinth = min(0.08, 0.1 * c.height)
    c.box((c.back, c.front - 0.04), (c.right, c.left), (0, plinth), recolored(wood, 0.6))
    carcass(c, (plinth, c.height - 0.03), recolored(wood, 0.85))
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.03, c.height), recolored(wood, 0.95))
    fronts(c, (c.right, c.left), (plinth, c.height - 0.03), max(1, round(c.width / 0.5)), 1, wood)


def nightstand(c: Canvas) -> None:
    """A small chest with two drawers."""
    wood = c.paint("#7a4f2e", "wood", 0.2)
    foot = min(0.08, 0.2 * c.height)
    c.legs(0.01, 0.035, foot, wood)
    carcass(c, (foot, c.height - 0.02), recolored(wood, 0.85))
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.02, c.height), wood)
    fronts(c, (c.right, c.left), (foot, c.height - 0.02), 1, 2, wood, "middle")


def bookshelf(c: Canvas) -> None:
    """Open shelves with rows of books and a vase."""
    wood = c.paint("#8b5e38", "wood", 0.15)
    board = 0.022
    c.box((c.back, c.front), (c.right, c.right + board), (0, c.height), wood)
    c.box((c.back, c.front), (c.left - board, c.left), (0, c.height), wood)
    c.box((c.back, c.back + 0.008), (c.right + board, c.left - board), (0, c.height), recolored(wood, 0.7))
    shelves = max(1, round(c.height / 0.36))
    step = (c.height - board) / shelves
    for k in range(shelves + 1):
        z = k * step
        c.box((c.back, c.front - 0.004), (c.right + board, c.left - board), (z, z + board), wood)
    draw = 7
    for k in range(shelves):
        floor, room = k * step + board, step - board
        y, end = c.right + board + 0.01, c.left - board - 0.03
        end -= 0.22 * c.width * (k % 3 == 1)
        while y < end:
            draw = (draw * 1103515245 + 12345) % 2**31
            thick = 0.022 + 0.03 * (draw >> 16) % 29 / 1000 + 0.012 * (draw >> 9 & 1)
            high = room * (0.62 + 0.3 * ((draw >> 12) % 16) / 16)
            deep = c.front - 0.02 - 0.05 * ((draw >> 7) % 8) / 8
            count = 1 + (draw >> 20) % 4
            cover = Material(rgb(_BOOKS[(draw >> 14) % len(_BOOKS)]), "books", 0.1)
            width = min(thick * count, end - y)
            c.box((c.back + 0.01, deep), (y, y + width), (floor, floor + high), cover)
            y += width + 0.002
        if k % 3 == 1:
            at = c.left - board - 0.11 * c.width
            clay = Material(rgb("#c98d63"), "plain", 0.3)
            c.ellipsoid((0, at, floor + 0.35 * room), (0.3 * c.depth, 0.075 * c.width, 0.35 * room), clay)
            c.cylinder(0, at, (floor + 0.6 * room, floor + 0.85 * room), 0.022, clay)
