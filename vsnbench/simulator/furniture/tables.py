"""Tables and screens."""

from vsnbench.simulator.furniture.canvas import Canvas, recolored, rgb
from vsnbench.simulator.primitives import Material


def dining_table(c: Canvas) -> None:
    """A wooden top on slanted legs, on trestles or on a frame with square legs."""
    wood = c.paint("#9a6a3f", "wood", 0.25)
    (_slanted, _trestle, _framed)[c.seed % 3](c, wood)


def _top(c: Canvas, thick: float, wood: Material) -> float:
    """Add the top; return the height of its underside."""
    low = c.height - min(thick, 0.12 * c.height)
    c.box((c.back, c.front), (c.right, c.left), (low, c.height), wood, 0.01)
    return low


def _slanted(c: Canvas, wood: Material) -> None:
    low = _top(c, 0.03, wood)
    for x in (-1, 1):
        for y in (-1, 1):
            foot = (x * (c.depth / 2 - 0.03), y * (c.width / 2 - 0.03), 0.0)
            head = (x * 0.35 * c.depth, y * 0.36 * c.width, low)
            c.beam(foot, head, 0.05, wood)


def _trestle(c: Canvas, wood: Material) -> None:
    low = _top(c, 0.05, wood)
    at = 0.36 * c.width
    for y in (-at, at):
        c.box((-0.06, 0.06), (y - 0.04, y + 0.04), (0.05, low - 0.05), wood)
        c.box((0.8 * c.back, 0.8 * c.front), (y - 0.04, y + 0.04), (0, 0.06), wood, 0.01)
        c.box((0.7 * c.back, 0.7 * c.front), (y - 0.04, y + 0.04), (low - 0.06, low), wood, 0.01)
    c.box((-0.02, 0.02), (-at, at), (0.25 * c.height, 0.25 * c.height + 0.08), wood)


def _framed(c: Canvas, wood: Material) -> None:
    low = _top(c, 0.04, wood)
    c.legs(0.04, 0.07, low, wood)
    rail = recolored(wood, 0.85)
    inset = 0.06
    for x in (c.back + inset, c.front - inset - 0.02):
        c.box((x, x + 0.02), (c.right + inset, c.left - inset), (low - 0.07, low), rail)
    for y in (c.right + inset, c.left - inset - 0.02):
        c.box((c.back + inset, c.front - inset), (y, y + 0.02), (low - 0.07, low), rail)


def coffee_table(c: Canvas) -> None:
    """A low table with slanted legs, or with straight legs and a shelf with magazines."""
    wood = c.paint("#5d3a22", "wood", 0.3)
    if c.seed % 2:
        _slanted(c, wood)
        return
    c.legs(0.03, 0.06, _top(c, 0.05, wood), wood)
    shelf = 0.3 * c.height
    c.box((c.back + 0.05, c.front - 0.05), (c.right + 0.05, c.left - 0.05), (shelf - 0.02, shelf), recolored(wood, 0.9))
    c.box((-0.12, 0.1), (0.05, 0.35), (shelf, shelf + 0.025), Material(rgb("#c0453a"), "plain", 0.2))
    c.box((-0.1, 0.12), (0.07, 0.34), (shelf + 0.025, shelf + 0.04), Material(rgb("#3f6f8f"), "plain", 0.2))


def desk(c: Canvas) -> None:
    """A white top on metal legs, with drawers on the right of the user."""
    top = c.paint("#e4dfd6", "plain", 0.2)
    metal = Material(rgb("#8d9196"), "metal", 0.5)
    thick = min(0.035, 0.1 * c.height)
    c.box((c.back, c.front), (c.right, c.left), (c.height - thick, c.height), top)
    c.legs(0.02, 0.05, c.height - thick, metal)
    c.box((c.back + 0.02, c.back + 0.04), (c.right + 0.06, c.left - 0.06), (0.45 * c.height, c.height - 0.1), metal)
    wide = min(0.4, 0.3 * c.width)
    low = 0.35 * c.height
    unit = c.left - 0.09
    c.box((c.back + 0.06, c.front - 0.08), (unit - wide, unit), (low, c.height - thick), recolored(top, 0.96))
    drawers = 2
    step = (c.height - thick - low) / drawers
    for k in range(drawers):
        z = low + k * step
        c.box((c.front - 0.08, c.front - 0.065), (unit - wide + 0.01, unit - 0.01), (z + 0.01, z + step - 0.01), top)
        middle = unit - wide / 2
        c.rod("y", (c.front - 0.055, middle, z + step * 0.6), 0.006, 0.14, metal)


def desk_monitor(c: Canvas) -> None:
    """A screen on a stand with a round foot."""
    _screen(c, bottom=0.24 * c.height, foot="stand")


def television(c: Canvas) -> None:
    """A wide screen close to the furniture, on two feet."""
    _screen(c, bottom=0.07 * c.height, foot="feet")


def _screen(c: Canvas, bottom: float, foot: str) -> None:
    case = c.paint("#1d1e21", "plain", 0.4)
    metal = Material(rgb("#55585d"), "metal", 0.5)
    thick = min(0.035, 0.45 * c.depth)
    middle = min(0.1 * c.depth, c.front - thick)
    c.box((middle, middle + thick * 0.7), (c.right, c.left), (bottom, c.height), case, 0.006)
    c.box(
        (middle - thick * 0.8, middle),
        (0.55 * c.right, 0.55 * c.left),
        (bottom + 0.15 * (c.height - bottom), c.height - 0.2 * (c.height - bottom)),
        case,
    )
    border = min(0.018, 0.04 * c.width)
    face = (middle + thick * 0.7, middle + thick * 0.7 + 0.002)
    picture = Material(rgb("#ffffff"), "screen" if foot == "stand" else "film", 0.5, 0.55)
    c.box(face, (c.right + border, c.left - border), (bottom + border * 1.3, c.height - border), picture)
    if foot == "stand":
        c.box((middle - thick * 1.2, middle - thick * 0.2), (-0.03, 0.03), (0.01, bottom + 0.3 * c.height), metal)
        c.box((c.back, c.front), (-0.26 * c.width, 0.26 * c.width), (0, min(0.014, 0.04 * c.height)), metal, 0.006)
    else:
        for side in (-1, 1):
            y = side * 0.34 * c.width
            c.box((c.back, c.front), (y - 0.012, y + 0.012), (0, min(0.015, 0.04 * c.height)), metal)
            c.box((middle, middle + thick * 0.6), (y - 0.012, y + 0.012), (0, bottom), metal)
