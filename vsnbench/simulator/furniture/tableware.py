"""Things on tables: place settings, bowls, bottles, books, laptops; visible, without a contact."""

import math
import zlib

import numpy as np
from numpy.random import Generator

from vsnbench.simulator.furniture.canvas import Canvas, pick, recolored, rgb, turn
from vsnbench.simulator.primitives import Material, Primitive, Shape
from vsnbench.sites.site import SiteObject

_HIGHEST_M = 0.45
_CHINA = Material(rgb("#f4f2ec"), "plain", 0.5)
_GLASS = Material(rgb("#cddcdc"), "plain", 0.7)
_FOODS = ("#c8442e", "#d98a2b", "#7d9a3a", "#c9a25a", "#8a4b2a", "#e0c05a")
_MUGS = ("#2f5d8a", "#b23b32", "#e8e3d8", "#3c6e57", "#d0a13c")
_COVERS = ("#7f2f2c", "#2d4f6e", "#c9a24b", "#3f6b4a", "#d9d2c0", "#b5603a")


def things_on(table: SiteObject) -> list[list[Primitive]]:
    """Return groups of parts on a table's top, in the table's frame, with z from its top."""
    if table.category != "table" or table.footprint is not None or table.model in ("box", "cylinder"):
        return []
    depth, width, _ = table.size_m
    if min(depth, width) < 0.35:
        return []
    random = np.random.default_rng(zlib.crc32(f"{table.id} {table.size_m}".encode()))
    top = _Top(Canvas(depth, width, _HIGHEST_M), random)
    if table.model == "desk":
        top.desk()
    elif table.model == "coffee_table":
        top.coffee_table()
    else:
        top.dining_table()
    return top.groups


class _Top:
    """Puts groups of things on a table's top."""

    def __init__(self, canvas: Canvas, random: Generator) -> None:
        self._canvas, self._random = canvas, random
        self.groups: list[list[Primitive]] = []

    def dining_table(self) -> None:
        """Place settings along both long sides, and food and drink in the middle."""
        c, random = self._canvas, self._random
        seats = max(1, int(c.width / 0.55))
        for side in (-1, 1):
            for k in range(seats):
                y = c.right + (k + 0.5) * c.width / seats
                self._setting(side * (c.depth / 2 - 0.19), y, side)
        middle = [self._bottle, self._fruit, self._dish]
        spots = max(2, int(c.width / 0.3))
        start = random.integers(len(middle))
        for k in range(spots):
            y = c.right + (k + 0.5) * c.width / spots + random.uniform(-0.03, 0.03)
            middle[(start + k) % len(middle)](random.uniform(-0.03, 0.03), y)

    def coffee_table(self) -> None:
        """Cups, a bowl or a vase, and books."""
        c, random = self._canvas, self._random
        things = [self._books, self._mug, self._fruit, self._bottle, self._dish, self._mug]
        spots = max(2, int(c.width / 0.22))
        start = random.integers(len(things))
        for k in range(spots):
            y = c.right + (k + 0.5) * c.width / spots
            things[(start + k) % len(things)](random.uniform(-0.2, 0.2) * c.depth, y)

    def desk(self) -> None:
        """A keyboard, paper, a mug, books at one end."""
        c, random = self._canvas, self._random
        side = pick(random, (-1, 1))
        self._keyboard(0.18 * c.depth, 0.0)
        self._mug(0.1 * c.depth, side * 0.36 * c.width)
        self._books(-0.15 * c.depth, -side * 0.38 * c.width)

    def _end_group(self) -> None:
        self.groups.append(self._canvas.parts)
        self._canvas.parts = []

    def _setting(self, x: float, y: float, side: int) -> None:
        """A plate with food, a glass, cutlery."""
        c, random = self._canvas, self._random
        c.cylinder(x, y, (0, 0.022), 0.125, _CHINA, 0.9)
        food = Material(rgb(pick(random, _FOODS)), "stone")
        c.ellipsoid((x, y, 0.028), (0.075, 0.075, 0.028), food)
        self._glass(x - side * 0.15, y + 0.12)
        steel = Material(rgb("#b9bcc0"), "metal", 0.7)
        for away in (-0.155, 0.155):
            c.box((x - 0.09, x + 0.09), (y + away - 0.009, y + away + 0.009), (0, 0.004), steel)
        self._end_group()

    def _glass(self, x: float, y: float) -> None:
        c, random = self._canvas, self._random
        wine = Material(rgb(pick(random, ("#7a1f2e", "#e3d9a0", "#cddcdc"))), "plain", 0.7)
        c.cylinder(x, y, (0, 0.005), 0.034, _GLASS)
        c.cylinder(x, y, (0.005, 0.085), 0.006, _GLASS)
        c.cylinder(x, y, (0.085, 0.14), 0.038, wine, 0.45)
        c.cylinder(x, y, (0.14, 0.185), 0.038, _GLASS, 1.15)

    def _bottle(self, x: float, y: float) -> None:
        c, random = self._canvas, self._random
        glass = Material(rgb(pick(random, ("#22381f", "#3a2415", "#2c4a37", "#7a8f58"))), "plain", 0.7)
        c.cylinder(x, y, (0, 0.19), 0.038, glass)
        c.cylinder(x, y, (0.19, 0.235), 0.038, glass, 2.7)
        c.cylinder(x, y, (0.235, 0.305), 0.014, glass)
        c.cylinder(x, y, (0.06, 0.14), 0.039, Material(rgb("#e6dfc8"), "plain"))
        self._end_group()

    def _fruit(self, x: float, y: float) -> None:
        c, random = self._canvas, self._random
        c.cylinder(
            x, y, (0, 0.075), 0.13, Material(rgb(pick(random, ("#e8e4da", "#7a4f2e", "#5f7f8c"))), "plain", 0.4), 0.72
        )
        for k in range(6):
            around = math.tau * k / 5
            reach = 0.065 if k < 5 else 0.0
            skin = Material(rgb(("#d9822b", "#c23a2c", "#d9b83a", "#7ba23f")[(k + int(10 * x)) % 4]), "plain", 0.3)
            at = (x + reach * math.cos(around), y + reach * math.sin(around), 0.085 if k < 5 else 0.12)
            c.ellipsoid(at, (0.04, 0.04, 0.038), skin)
        self._end_group()

    def _dish(self, x: float, y: float) -> None:
        c, random = self._canvas, self._random
        c.cylinder(x, y, (0, 0.06), 0.13, _CHINA, 0.75)
        for _ in range(3):
            at = (x + random.uniform(-0.05, 0.05), y + random.uniform(-0.05, 0.05), 0.058)
            c.ellipsoid(at, (0.07, 0.06, 0.032), Material(rgb(pick(random, _FOODS)), "stone"))
        self._end_group()

    def _mug(self, x: float, y: float) -> None:
        c = self._canvas
        glaze = Material(rgb(pick(self._random, _MUGS)), "plain", 0.5)
        c.cylinder(x, y, (0, 0.095), 0.042, glaze, 0.9)
        c.cylinder(x, y, (0.094, 0.096), 0.036, Material(rgb("#3a2417")))
        c.box((x - 0.006, x + 0.006), (y + 0.04, y + 0.068), (0.025, 0.075), glaze, 0.01)
        self._end_group()

    def _books(self, x: float, y: float) -> None:
        c, random = self._canvas, self._random
        low = 0.0
        for _ in range(random.integers(2, 5)):
            thick, cover = random.uniform(0.015, 0.035), Material(rgb(pick(random, _COVERS)), "plain", 0.2)
            angle = turn((0, 0, 1), random.uniform(-0.35, 0.35))
            c.place(Shape.BOX, (x, y, low + thick / 2), (0.085, 0.12, thick / 2), cover, angle)
            pages = recolored(_CHINA, 0.9)
            c.place(Shape.BOX, (x + 0.003, y, low + thick / 2), (0.084, 0.118, thick / 2 - 0.004), pages, angle)
            low += thick
        self._end_group()

    def _keyboard(self, x: float, y: float) -> None:
        c = self._canvas
        dark = Material(rgb("#25272b"), "plain", 0.2)
        c.box((x - 0.07, x + 0.07), (y - 0.22, y + 0.22), (0, 0.02), dark, 0.006)
        for row in range(4):
            at = x - 0.05 + 0.032 * row
            c.box((at - 0.013, at + 0.013), (y - 0.205, y + 0.205), (0.02, 0.024), recolored(dark, 1.6))
        c.ellipsoid((x, y + 0.32, 0.016), (0.055, 0.03, 0.018), dark)
        self._end_group()
