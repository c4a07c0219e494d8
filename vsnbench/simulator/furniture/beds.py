"""Beds."""

import math

from vsnbench.simulator.furniture.canvas import Canvas, multiply, pick, recolored, rgb, turn
from vsnbench.simulator.primitives import Material, Shape

_WOODS = ("#6b4426", "#b98a5a", "#3f2c20", "#e2d3b8")


def bed(c: Canvas) -> None:
    """A headboard at the back, a frame, a mattress, a duvet with folds, pillows."""
    random = c.random
    linen = Material(rgb("#f1eee6"), "cloth")
    cover = c.paint("#6d4d8e", "cloth")
    padded = random.random() < 0.4
    wood = recolored(cover, 0.6) if padded else Material(rgb(pick(random, _WOODS)), "wood", 0.15)
    board = min(0.08, c.depth / 10)
    top = c.height * (0.66 if c.height < 0.7 else 0.55)
    head = c.back + board
    if padded:
        panels = max(1, round(c.width / 0.5))
        for k in range(panels):
            y = c.right + k * c.width / panels
            c.box((c.back, head), (y + 0.002, y + c.width / panels - 0.002), (0, c.height), wood, 0.025)
    else:
        c.box((c.back, head - 0.02), (c.right, c.left), (0, c.height), wood, 0.012)
    c.legs(0.03, 0.07, 0.3 * top, recolored(wood, 0.7))
    c.box((head, c.front), (c.right, c.left), (0.22 * top, 0.48 * top), wood, 0.012)
    rim = 0.02
    c.box((head, c.front - rim), (c.right + rim, c.left - rim), (0.46 * top, top), linen, 0.045)
    pillows = 2 if c.width > 1.15 else 1
    fold = head + 0.27 * (c.depth - board)
    low, high = 0.5 * top, top + 0.045
    c.box((fold, c.front - 0.004), (c.right + 0.004, c.left - 0.004), (low, high), cover, 0.05)
    c.box((fold - 0.03, fold + 0.2), (c.right + 0.002, c.left - 0.002), (0.62 * top, high + 0.02), linen, 0.03)
    for _ in range(9):
        along = random.uniform(-0.6, 0.6)
        at = (fold + random.uniform(0.2, 0.9) * (c.front - fold), random.uniform(-0.8, 0.8) * c.left, high - 0.004)
        half = (random.uniform(0.15, 0.32), random.uniform(0.03, 0.06), 0.02)
        c.place(Shape.ELLIPSOID, at, half, cover, turn((0, 0, 1), along), solid=False)
    for side in (c.right + 0.006, c.left - 0.006):  # hanging folds
        for k in range(5):
            x = fold + (k + 0.5) * (c.front - fold) / 5 + random.uniform(-0.08, 0.08)
            c.place(
                Shape.ELLIPSOID, (x, side, (low + high) / 2), (0.05, 0.012, 0.45 * (high - low)), cover, solid=False
            )
    for k in range(pillows):
        y = c.right + (k + 0.5) * c.width / pillows
        wide = min(0.34, 0.44 * c.width / pillows)
        for away, angle, thing in ((0.1, -1.0, linen), (0.27, -0.5, recolored(linen, 0.96))):
            lift = 0.2 * abs(math.sin(angle)) * 0.6
            c.place(
                Shape.BOX,
                (head + away, y, top + 0.05 + lift),
                (0.2, wide, 0.065),
                thing,
                multiply(turn((0, 1, 0), angle), turn((0, 0, 1), 0.04 * (-1) ** k)),
                bevel_m=0.05,
            )
