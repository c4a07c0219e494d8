"""The building as primitives: floors, ceiling, walls with doorways and windows, frames, skirting."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import shapely
from shapely.geometry import LineString, Polygon

from vsnbench.simulator.furniture.canvas import Span, rgb, turn
from vsnbench.simulator.primitives import Material, Primitive, Shape
from vsnbench.sites.geometry.walls import walls_of
from vsnbench.sites.site import Door, Room, Site, Wall, Window

_PLASTER = Material(rgb("#e9e3d6"), "plaster")
_TILED_WALL = Material(rgb("#cfe0e2"), "wall_tiles", 0.3)
_STEEL = Material(rgb("#c2c5c9"), "metal", 0.6)
_FRAME = Material(rgb("#f3f1ec"), "plain", 0.2)
_SKIRTING = Material(rgb("#e4ded2"), "plain", 0.2)
_DOOR_WOOD = Material(rgb("#9b6f47"), "wood", 0.2)
_SKY = Material(rgb("#ffffff"), "sky", 0.0, 1.0)
_CEILING = Material(rgb("#f5f3ee"), "plaster")
_CEILING_LIGHT = Material(rgb("#fff6e0"), "plain", 0.0, 0.9)
_FLOORS = {
    "wood": Material(rgb("#b07c4c"), "planks", 0.35),
    "tiles": Material(rgb("#d5d6d4"), "tiles", 0.45),
    "carpet": Material(rgb("#8f8577"), "carpet"),
    "concrete": Material(rgb("#a5a39f"), "stone", 0.1),
}
_SKIN = 0.001
"""Distance between coverings, metres, so that no two visible surfaces share a plane."""


def build_structure(site: Site, *, is_surveyed_only: bool = False) -> Iterator[Primitive]:
    """Yield the primitives of a site's building; `instance` is 0. No survey has the lights at the ceiling."""
    yield from _floors(site)
    if not is_surveyed_only:
        for room in site.rooms:
            yield from _ceiling_lights(room, site.ceiling_height_m)
    for wall in site.walls:
        yield from _wall(site, wall)


def _slab(
    edges: tuple[float, float, float, float], z: Span, material: Material, category: str, *, solid: bool = True
) -> Primitive:
    """Return a horizontal slab; `edges` are x_min, y_min, x_max and y_max."""
    x0, y0, x1, y1 = edges
    return Primitive(
        Shape.BOX,
        ((x0 + x1) / 2, (y0 + y1) / 2, (z[0] + z[1]) / 2),
        ((x1 - x0) / 2, (y1 - y0) / 2, (z[1] - z[0]) / 2),
        material,
        category=category,
        solid=solid,
    )


def site_bounds(site: Site) -> tuple[float, float, float, float]:
    """Return (x_min, y_min, x_max, y_max) around all rooms and walls, metres."""
    shapes = [room.shape for room in site.rooms] + [wall.shape for wall in site.walls]
    x_min, y_min, x_max, y_max = shapely.total_bounds(shapes).tolist()
    return (x_min, y_min, x_max, y_max)


def _floors(site: Site) -> Iterator[Primitive]:
    base, bounds = _FLOORS[site.rooms[0].floor], site_bounds(site)
    # The robot drives on one slab: the wheels would react to seams between the rooms' floors.
    yield replace(_slab(bounds, (-0.1, 0.0), base, "floor"), visible=False)
    yield _slab(bounds, (-0.1, -_SKIN), base, "floor", solid=False)
    for room in site.rooms:
        material = _FLOORS[room.floor]
        if room.floor_color is not None:
            material = replace(material, color=rgb(room.floor_color))
        for edges in rectangles(room.shape):
            yield _slab(edges, (-_SKIN, 0.0), material, "floor", solid=False)
    yield _slab(bounds, (site.ceiling_height_m, site.ceiling_height_m + 0.1), _CEILING, "ceiling")


def _ceiling_lights(room: Room, ceiling_m: float) -> Iterator[Primitive]:
    """Yield flat round lights, about one per four metres of a room."""
    bands = list(rectangles(room.shape, slice_m=2.0))
    wide = [band for band in bands if min(band[2] - band[0], band[3] - band[1]) > 1.2] or bands
    for x0, y0, x1, y1 in wide:
        columns, rows = math.ceil((x1 - x0) / 4), math.ceil((y1 - y0) / 4)
        for k in range(columns * rows):
            x = x0 + (x1 - x0) * (k % columns + 0.5) / columns
            y = y0 + (y1 - y0) * (k // columns + 0.5) / rows
            yield Primitive(
                Shape.CYLINDER,
                (x, y, ceiling_m - 0.025),
                (0.17, 0.17, 0.025),
                _CEILING_LIGHT,
                category="ceiling",
                solid=False,
            )


def rectangles(
    outline: Polygon, inscribed: bool = False, slice_m: float = 0.05
) -> Iterator[tuple[float, float, float, float]]:
    """Cut a polygon into rectangles (x0, y0, x1, y1), exact if its edges are parallel to the axes.

    Slanted edges become steps of `slice_m`, halfway across the edge or, if `inscribed`, inside it.
    """
    levels = sorted({round(y, 6) for _, y in outline.exterior.coords})
    for low, high in itertools.pairwise(levels):
        if high - low < 1e-4:
            continue
        ends = zip(_crossings(outline, low + 1e-6), _crossings(outline, high - 1e-6), strict=True)
        for (x0, x1), (x2, x3) in ends:
            square = max(abs(x0 - x2), abs(x1 - x3)) < 1e-4
            steps = 1 if square else math.ceil((high - low) / slice_m)
            for k in range(steps):
                shares = (k / steps, (k + 1) / steps) if inscribed else ((k + 0.5) / steps,)
                left = max(x0 + (x2 - x0) * share for share in shares)
                right = min(x1 + (x3 - x1) * share for share in shares)
                if right - left > 1e-4:
                    yield (left, low + (high - low) * k / steps, right, low + (high - low) * (k + 1) / steps)


def _crossings(outline: Polygon, y: float) -> list[tuple[float, float]]:
    """Return the segments of a horizontal line inside a polygon, from left to right."""
    corners = list(outline.exterior.coords)
    at = sorted(
        xa + (xb - xa) * (y - ya) / (yb - ya)
        for (xa, ya), (xb, yb) in itertools.pairwise(corners)
        if (ya > y) != (yb > y)
    )
    return list(zip(at[::2], at[1::2], strict=True))


@dataclass(frozen=True, slots=True)
class _Run:
    """Frame of a wall: distance along it, distance across it, height."""

    wall: Wall

    @property
    def half(self) -> float:
        """Half the thickness of the wall."""
        return self.wall.thickness_m / 2

    def block(
        self,
        along: Span,
        across: Span,
        z: Span,
        material: Material,
        category: str = "wall",
        solid: bool = True,
    ) -> Primitive:
        (x0, y0), (x1, y1) = self.wall.start, self.wall.end
        return Primitive(
            Shape.BOX,
            (*self.point(sum(along) / 2, sum(across) / 2), sum(z) / 2),
            ((along[1] - along[0]) / 2, (across[1] - across[0]) / 2, (z[1] - z[0]) / 2),
            material,
            turn((0, 0, 1), math.atan2(y1 - y0, x1 - x0)),
            category,
            solid=solid,
        )

    def point(self, along: float, across: float) -> tuple[float, float]:
        """Return a point on the floor plan."""
        (x0, y0), (x1, y1) = self.wall.start, self.wall.end
        ux, uy = (x1 - x0) / self.wall.length_m, (y1 - y0) / self.wall.length_m
        return (x0 + ux * along - uy * across, y0 + uy * along + ux * across)

    def along(self, x: float, y: float) -> float:
        """Return the coordinate along the wall of a point on the floor plan."""
        (x0, y0), (x1, y1) = self.wall.start, self.wall.end
        return ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / self.wall.length_m

    def place(self, site: Site, opening: Door | Window) -> Span | None:
        """Return the ends of a door or window along the wall, or None if it is not on this wall."""
        if self.wall not in walls_of(site, opening.start, opening.end):
            return None
        ends = (self.along(*opening.start), self.along(*opening.end))
        return (min(ends), max(ends))


def _face(side: int, near: float, far: float) -> Span:
    """Return the span between two distances from the wall's centre line on one side of it, -1 or 1."""
    return (near, far) if side > 0 else (-far, -near)


_JAMB = 0.04
_CLADDING_M = 2.0
"""Height of the tiles on the walls of tiled rooms, metres."""


def _wall(site: Site, wall: Wall) -> Iterator[Primitive]:
    run = _Run(wall)
    half = run.half
    height = site.ceiling_height_m if wall.height_m is None else min(wall.height_m, site.ceiling_height_m)
    material = _PLASTER if wall.color is None else replace(_PLASTER, color=rgb(wall.color))
    openings: list[tuple[Span, Span]] = []  # along the wall, heights
    for door in site.doors:
        at = run.place(site, door)
        if at is not None:
            top = min(door.height_m, height)
            openings.append(((at[0] - _JAMB, at[1] + _JAMB), (0.0, min(top + _JAMB, height))))
            yield from _door_frame(run, at, top)
            if door.closed:
                yield from _leaf(run, door, at, top)
    for window in site.windows:
        at = run.place(site, window)
        if at is not None and window.sill_m < height:
            head = min(window.head_m, height)
            openings.append((at, (window.sill_m, head)))
            yield from _window(run, at, window, head)
    openings.sort(key=lambda opening: opening[0][0])
    cursor = -half
    for (start, end), (bottom, top) in openings:
        if start > cursor:
            yield from _stretch(site, run, (cursor, start), height, material)
        span = (max(cursor, start), end)
        if bottom > 0:
            yield from _stretch(site, run, span, bottom, material)
        if height - top > 1e-3:
            yield run.block(span, (-half, half), (top, height), material)
        cursor = max(cursor, end)
    if wall.length_m + half > cursor:
        yield from _stretch(site, run, (cursor, wall.length_m + half), height, material)


def _stretch(site: Site, run: _Run, along: Span, height: float, material: Material) -> Iterator[Primitive]:
    half = run.half
    yield run.block(along, (-half, half), (0.0, height), material)
    yield from _cladding(site, run, along, height)
    if height > 0.3:
        yield run.block(along, (-half - 0.012, half + 0.012), (0.0, 0.07), _SKIRTING, solid=False)


def _door_frame(run: _Run, at: Span, top: float) -> Iterator[Primitive]:
    """Yield the lining inside the opening and the casing on both faces of the wall; the clear width stays free."""
    height, half = top + _JAMB, run.half
    for low, high in ((at[0] - _JAMB, at[0]), (at[1], at[1] + _JAMB)):
        yield run.block((low, high), (-half, half), (0.0, height), _DOOR_WOOD, "door")
    yield run.block(at, (-half, half), (top, height), _DOOR_WOOD, "door")
    for side in (-1, 1):
        across = _face(side, half, half + 0.015)
        for low, high in ((at[0] - 0.07, at[0]), (at[1], at[1] + 0.07)):
            yield run.block((low, high), across, (0.0, top), _DOOR_WOOD, "door", solid=False)
        yield run.block((at[0] - 0.07, at[1] + 0.07), across, (top, top + 0.07), _DOOR_WOOD, "door", solid=False)


def _leaf(run: _Run, door: Door, at: Span, top: float) -> Iterator[Primitive]:
    """Yield a closed door's leaf with panels and handles."""
    leaf = max(run.half - 0.03, 0.02)
    yield run.block(at, (-leaf, leaf), (0.0, top), _DOOR_WOOD, "door")
    wide = at[1] - at[0]
    panel = replace(_DOOR_WOOD, color=rgb("#8a603b"))
    hinge_low = math.dist(door.start, run.wall.start) < math.dist(door.end, run.wall.start)
    lock = at[1] - 0.08 if hinge_low else at[0] + 0.08
    inwards = -0.12 if hinge_low else 0.12
    for side in (-1, 1):
        for low, high in ((0.12 * top, 0.42 * top), (0.56 * top, 0.93 * top)):
            span = (at[0] + 0.16 * wide, at[1] - 0.16 * wide)
            yield run.block(span, _face(side, leaf, leaf + 0.006), (low, high), panel, "door", solid=False)
        plate, handle = _face(side, leaf, leaf + 0.008), _face(side, leaf + 0.02, leaf + 0.035)
        yield run.block((lock - 0.02, lock + 0.02), plate, (0.98, 1.14), _STEEL, "door", solid=False)
        along = (min(lock, lock + inwards), max(lock, lock + inwards))
        yield run.block(along, handle, (1.06, 1.08), _STEEL, "door", solid=False)


def _cladding(site: Site, run: _Run, along: Span, height: float) -> Iterator[Primitive]:
    """Yield tiles on the sides of a wall segment that face a room with a tiled floor."""
    z = (0.0, min(height, _CLADDING_M))
    for side in (-1, 1):
        line = LineString([run.point(distance, side * (run.half + 0.02)) for distance in along])
        for room in site.rooms:
            if room.floor != "tiles":
                continue
            shared = line.intersection(room.shape)
            for piece in getattr(shared, "geoms", [shared]):
                if piece.length > 0.01:
                    ends = [run.along(*point) for point in piece.coords]
                    face = _face(side, run.half, run.half + 0.005)
                    yield run.block((min(ends), max(ends)), face, z, _TILED_WALL, solid=False)


def _window(run: _Run, at: Span, window: Window, head: float) -> Iterator[Primitive]:
    sill = window.sill_m
    edge = 0.05
    pane = (-0.01, 0.01)
    yield run.block((at[0] + edge, at[1] - edge), pane, (sill + edge, head - edge), _SKY, "window")
    bar = (-0.03, 0.03)
    for low, high in ((at[0], at[0] + edge), (at[1] - edge, at[1])):
        yield run.block((low, high), bar, (sill, head), _FRAME, "window")
    for low, high in ((sill, sill + edge), (head - edge, head)):
        yield run.block((at[0] + edge, at[1] - edge), bar, (low, high), _FRAME, "window")
    if at[1] - at[0] > 0.9:
        middle = (at[0] + at[1]) / 2
        yield run.block((middle - 0.025, middle + 0.025), bar, (sill + edge, head - edge), _FRAME, "window")
    ledge = run.half + 0.04
    yield run.block((at[0] - 0.03, at[1] + 0.03), (-ledge, ledge), (sill - 0.03, sill), _FRAME, "window", solid=False)
