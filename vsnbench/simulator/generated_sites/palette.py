"""Colours and sizes of furniture."""

import colorsys

from numpy.random import Generator

_WOODS = ("#6f4a2d", "#8b5e38", "#b98a5a", "#d0ab7c", "#5d3a22", "#a87a4d", "#3f2c20", "#e2d3b8", "#ece8e0")
_WALLS = ("#e9e3d6", "#f0eee8", "#dfe4e2", "#e8ddca", "#d9dfe6", "#e6d9d3", "#d5dccb", "#ead9b5", "#c9d3d8")
_FLOORS = {
    "wood": ("#b07c4c", "#8a5c36", "#c99a67", "#6e4a30", "#a98e70"),
    "tiles": ("#d5d6d4", "#c9bfae", "#9fa6a8", "#e3dccf", "#7f8487"),
    "carpet": ("#8f8577", "#6f7680", "#a59a84", "#7d6a62"),
    "concrete": ("#a5a39f", "#8d8c89", "#b9b6b0"),
}


def wood(rng: Generator) -> str:
    """Return the colour of a wooden or painted piece."""
    return str(rng.choice(_WOODS))


def wall(rng: Generator) -> str:
    """Return a pale colour for a wall."""
    return str(rng.choice(_WALLS))


def floor(rng: Generator, kind: str) -> str:
    """Return a colour for a floor of a kind."""
    return str(rng.choice(_FLOORS[kind]))


def fabric(rng: Generator) -> str:
    """Return a colour for a cover: any hue, from nearly grey to saturated."""
    return _from_hsv(rng.uniform(0, 1), rng.uniform(0.05, 0.75), rng.uniform(0.25, 0.8))


def pale(rng: Generator) -> str:
    """Return a colour for machines, ceramics and lamp shades."""
    return _from_hsv(rng.uniform(0.05, 0.6), rng.uniform(0.0, 0.12), rng.uniform(0.78, 0.97))


def dark(rng: Generator) -> str:
    """Return a colour for the cases of screens."""
    return _from_hsv(rng.uniform(0, 1), rng.uniform(0.0, 0.15), rng.uniform(0.08, 0.3))


def clay(rng: Generator) -> str:
    """Return a colour for a plant's pot."""
    return _from_hsv(rng.uniform(0.0, 0.12), rng.uniform(0.05, 0.65), rng.uniform(0.35, 0.9))


def size(
    rng: Generator, depth_m: float, width_m: float, height_m: float, spread: float = 0.1
) -> tuple[float, float, float]:
    """Return (depth, width, height), each within `spread` of the usual value; whole centimetres."""
    d, w, h = (round(float(m * rng.uniform(1 - spread, 1 + spread)), 2) for m in (depth_m, width_m, height_m))
    return (d, w, h)


def _from_hsv(hue: float, saturation: float, value: float) -> str:
    red, green, blue = colorsys.hsv_to_rgb(hue, saturation, value)
    return f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"
