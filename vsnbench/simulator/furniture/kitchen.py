"""Kitchen furniture and machines."""

from vsnbench.simulator.furniture.canvas import Canvas, recolored, rgb
from vsnbench.simulator.furniture.storage import carcass, fronts
from vsnbench.simulator.primitives import Material

_STEEL = Material(rgb("#c2c5c9"), "metal", 0.6)
_DARK = Material(rgb("#1f2022"), "plain", 0.5)


def counter(c: Canvas) -> None:
    """Base cupboards with one row of drawers under a worktop."""
    front = c.paint("#e9e6df", "plain", 0.25)
    top = min(0.04, 0.1 * c.height)
    plinth = 0.11 * c.height
    c.box((c.back, c.front - 0.06), (c.right, c.left), (0, plinth), Material(rgb("#4a4743")))
    carcass(c, (plinth, c.height - top), recolored(front, 0.8))
    c.box((c.back, c.front), (c.right, c.left), (c.height - top, c.height), Material(rgb("#57514b"), "stone", 0.4))
    columns = max(1, round(c.width / 0.5))
    split = plinth + 0.76 * (c.height - top - plinth)
    fronts(c, (c.right, c.left), (plinth, split), columns, 1, front)
    fronts(c, (c.right, c.left), (split, c.height - top), columns, 1, front, "middle")


def stove(c: Canvas) -> None:
    """An oven with a window and knobs below four burners."""
    body = c.paint("#d7d9db", "metal", 0.5)
    plinth = 0.1 * c.height
    c.box((c.back, c.front - 0.06), (c.right, c.left), (0, plinth), Material(rgb("#4a4743")))
    c.box((c.back, c.front - 0.03), (c.right, c.left), (plinth, c.height - 0.02), body)
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.02, c.height - 0.008), _DARK)
    for x in (-0.22, 0.24):
        for y, radius in ((-0.24, 0.085), (0.24, 0.105)):
            c.cylinder(
                x * c.depth, y * c.width, (c.height - 0.008, c.height), radius * c.width / 0.6, recolored(_DARK, 1.9)
            )
    low, high = plinth + 0.12 * c.height, 0.8 * c.height
    c.box((c.front - 0.03, c.front - 0.02), (c.right + 0.005, c.left - 0.005), (plinth + 0.02, high), body)
    c.box((c.front - 0.02, c.front - 0.016), (0.76 * c.right, 0.76 * c.left), (low, high - 0.09), _DARK)
    c.rod("y", (c.front - 0.009, 0, high - 0.035), 0.009, 0.8 * c.width, _STEEL)
    for y in (-0.36, -0.2, 0.0, 0.2, 0.36):
        c.rod("x", (c.front - 0.012, y * c.width, 0.88 * c.height), 0.018, 0.024, _DARK)


def refrigerator(c: Canvas) -> None:
    """A freezer below, a cooler above, long handles."""
    body = c.paint("#d3d7da", "metal", 0.45)
    c.box((c.back, c.front - 0.08), (c.right + 0.02, c.left - 0.02), (0, 0.03), Material(rgb("#333538")))
    c.box((c.back, c.front - 0.075), (c.right, c.left), (0.03, c.height), recolored(body, 0.88))
    split = 0.36 * c.height
    for low, high in ((0.035, split - 0.004), (split + 0.004, c.height)):
        c.box((c.front - 0.07, c.front - 0.03), (c.right, c.left), (low, high), body)
    y = c.left - 0.07
    for low, high in ((split - 0.3, split - 0.05), (split + 0.05, split + 0.5)):
        c.box((c.front - 0.012, c.front), (y, y + 0.022), (low, high), _STEEL)
        for z in (low + 0.015, high - 0.035):
            c.box((c.front - 0.03, c.front - 0.012), (y, y + 0.022), (z, z + 0.02), _STEEL)


def kitchen_sink(c: Canvas) -> None:
    """A steel rim on the worktop around a dark bowl, and an arched tap behind it."""
    rim = 0.012
    c.box((c.back, c.front), (c.right, c.left), (0, rim), _STEEL)
    c.box(
        (c.back + 0.22 * c.depth, c.front - 0.08 * c.depth),
        (0.88 * c.right, 0.88 * c.left),
        (rim, rim + 0.001),
        Material(rgb("#6c7074"), "metal", 0.4),
    )
    _tap(c, c.back + 0.1 * c.depth, rim)


def washing_machine(c: Canvas) -> None:
    """A white box with a round door and a control panel."""
    body = c.paint("#eceded", "plain", 0.35)
    c.box((c.back, c.front - 0.03), (c.right, c.left), (0.02, c.height - 0.025), body)
    c.box((c.back, c.front), (c.right, c.left), (c.height - 0.025, c.height), body)
    c.legs(0.04, 0.05, 0.02, _DARK)
    middle = 0.45 * c.height
    radius = min(0.3 * c.width, 0.26 * c.height)
    c.rod("x", (c.front - 0.022, 0, middle), radius, 0.016, _STEEL)
    c.rod("x", (c.front - 0.012, 0, middle), radius * 0.78, 0.02, Material(rgb("#2c3440"), "plain", 0.7))
    panel = (0.82 * c.height, c.height - 0.035)
    c.box((c.front - 0.03, c.front - 0.024), (c.right + 0.005, c.left - 0.005), panel, recolored(body, 0.9))
    c.rod("x", (c.front - 0.012, 0.05 * c.width, sum(panel) / 2), 0.028, 0.022, _STEEL)
    c.box((c.front - 0.024, c.front - 0.02), (0.9 * c.right, 0.5 * c.right), panel, recolored(body, 0.97))
    c.box(
        (c.front - 0.024, c.front - 0.021),
        (0.45 * c.left, 0.85 * c.left),
        (panel[0] + 0.02, panel[1] - 0.02),
        Material(rgb("#24303a"), "plain", 0.5, 0.1),
    )


def _tap(c: Canvas, x: float, z: float) -> None:
    tall = c.height
    c.cylinder(x, 0, (z, tall - 0.012), 0.014, _STEEL)
    reach = 0.35 * c.depth
    c.rod("x", (x + reach / 2, 0, tall - 0.012), 0.012, reach, _STEEL)
    c.cylinder(x + reach - 0.012, 0, (tall - 0.05, tall - 0.012), 0.011, _STEEL)
    c.rod("y", (x, 0.03, z + 0.35 * (tall - z)), 0.007, 0.07, _STEEL)
