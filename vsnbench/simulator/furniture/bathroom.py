"""Bathroom furniture."""

from vsnbench.simulator.furniture.canvas import Canvas, recolored, rgb
from vsnbench.simulator.furniture.storage import fronts
from vsnbench.simulator.primitives import Material

_STEEL = Material(rgb("#c8cbcf"), "metal", 0.7)
_CERAMIC = "#f6f5f1"


def toilet(c: Canvas) -> None:
    """A pedestal, a bowl with a seat and a lid, a cistern with its button at the back."""
    white = c.paint(_CERAMIC, "plain", 0.6)
    tank = 0.27 * c.depth
    rim = 0.52 * c.height
    reach = (c.depth - tank) / 2
    middle = c.back + tank + reach
    wide = 0.46 * c.width
    c.box((c.back, c.back + tank), (c.right, c.left), (rim, c.height - 0.03), white, 0.025)
    c.box((c.back, c.back + tank + 0.008), (c.right, c.left), (c.height - 0.03, c.height), recolored(white, 0.97))
    c.cylinder(c.back + tank / 2, 0, (c.height - 0.008, c.height), 0.022, _STEEL)
    c.box((c.back, middle), (-0.55 * wide, 0.55 * wide), (0, rim - 0.05), white, 0.04)
    c.cylinder(middle, 0, (0, 0.45 * rim), 0.7 * min(reach, wide), white, 0.8)
    c.ellipsoid((middle, 0, 0.62 * rim), (reach, wide, 0.38 * rim), white)
    c.ellipsoid((middle, 0, rim - 0.02), (reach, wide, 0.035), recolored(white, 0.93))
    c.ellipsoid((middle, 0, rim + 0.022), (reach * 0.99, wide * 0.99, 0.022), white)
    water = Material(rgb("#6d7a80"), "plain", 0.4)
    c.ellipsoid((middle + 0.04 * reach, 0, rim + 0.028), (reach * 0.68, wide * 0.62, 0.02), water)
    leaning = c.back + tank
    c.box(
        (leaning, leaning + 0.022),
        (-0.9 * wide, 0.9 * wide),
        (rim + 0.02, c.height - 0.05),
        recolored(white, 0.98),
        0.01,
    )


def vanity(c: Canvas) -> None:
    """A wash basin on a cabinet, with a tap."""
    wood = c.paint("#e6e1d6", "plain", 0.2)
    top = 0.8 * c.height
    c.box((c.back, c.front - 0.04), (c.right + 0.01, c.left - 0.01), (0, 0.08 * c.height), recolored(wood, 0.45))
    c.box((c.back, c.front - 0.02), (c.right, c.left), (0.08 * c.height, top), recolored(wood, 0.85))
    fronts(c, (c.right, c.left), (0.08 * c.height, top), 2 if c.width > 0.45 else 1, 1, wood)
    white = Material(rgb(_CERAMIC), "plain", 0.6)
    slab = top + min(0.07, 0.1 * c.height)
    c.box((c.back, c.front), (c.right, c.left), (top, slab), white)
    reach = (0.36 * c.depth, 0.4 * c.width)
    c.ellipsoid((0.07 * c.depth, 0, slab - 0.004), (*reach, 0.012), recolored(white, 0.86))
    inner = (0.9 * reach[0], 0.92 * reach[1])
    c.ellipsoid((0.07 * c.depth, 0, slab), (*inner, 0.012), Material(rgb("#c3cbcd"), "plain", 0.5))
    x = c.back + 0.06
    c.cylinder(x, 0, (top, c.height - 0.01), 0.016, _STEEL)
    c.rod("x", (x + 0.12 * c.depth, 0, c.height - 0.012), 0.012, 0.28 * c.depth, _STEEL)


def bathtub(c: Canvas) -> None:
    """A tub with a raised rim and water; the tap is at the narrow end."""
    white = c.paint(_CERAMIC, "plain", 0.6)
    rim = min(0.08, 0.15 * min(c.depth, c.width))
    c.box((c.back, c.front), (c.right, c.left), (0, 0.72 * c.height), white)
    top = (0.72 * c.height, 0.92 * c.height)
    c.box((c.back, c.back + rim), (c.right, c.left), top, white)
    c.box((c.front - rim, c.front), (c.right, c.left), top, white)
    c.box((c.back + rim, c.front - rim), (c.right, c.right + rim), top, white)
    c.box((c.back + rim, c.front - rim), (c.left - rim, c.left), top, white)
    inside = Material(rgb("#b9d3da"), "plain", 0.7)
    c.box((c.back + rim, c.front - rim), (c.right + rim, c.left - rim), (0.72 * c.height, 0.76 * c.height), inside)
    along_y = c.width >= c.depth
    x, y = (0.0, c.right + rim / 2) if along_y else (c.back + rim / 2, 0.0)
    c.cylinder(x, y, (0.9 * c.height, c.height), 0.018, _STEEL)
    reach = min(0.16, 0.2 * max(c.depth, c.width))
    at = (x, y + reach / 2, c.height - 0.014) if along_y else (x + reach / 2, y, c.height - 0.014)
    c.rod("y" if along_y else "x", at, 0.013, reach, _STEEL)


def shower(c: Canvas) -> None:
    """A tray, glass sides with steel edges, a pipe with a shower head at the back."""
    white = c.paint(_CERAMIC, "plain", 0.5)
    tray = min(0.08, 0.1 * c.height)
    c.box((c.back, c.front), (c.right, c.left), (0, tray), white)
    c.cylinder(0, 0, (tray, tray + 0.004), min(0.05, c.depth / 8), _STEEL)
    glass = Material(rgb("#cfe0e2"), "glass", 0.8)
    for y in (c.right, c.left - 0.012):
        c.box((c.back, c.front), (y, y + 0.012), (tray, 0.93 * c.height), glass)
    for y in (c.right, c.left - 0.03):
        c.box((c.front - 0.03, c.front), (y, y + 0.03), (tray, c.height), _STEEL)
    c.box((c.front - 0.03, c.front), (c.right, c.left), (0.93 * c.height, 0.96 * c.height), _STEEL)
    x = c.back + 0.03
    c.cylinder(x, 0, (0.45 * c.height, c.height), 0.012, _STEEL)
    c.rod("x", (x + 0.1 * c.depth, 0, c.height - 0.02), 0.012, 0.22 * c.depth, _STEEL)
    c.cylinder(x + 0.2 * c.depth, 0, (c.height - 0.05, c.height - 0.02), min(0.09, c.depth / 6), _STEEL)
    c.rod("y", (x, 0, 0.48 * c.height), 0.02, 0.16, _STEEL)
