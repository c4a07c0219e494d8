"""The straight shapes of an SVG document, by the group that they are in, with every transform followed.

The document is untrusted: it is read as a stream, entities are refused where they are declared, nothing is fetched,
`use` is not followed, and depth and number of elements are bounded.
"""

import math
import re
from dataclasses import dataclass, field
from typing import Final, NoReturn
from xml.parsers.expat import ExpatError, ParserCreate

from vsnbench.errors import SiteError
from vsnbench.exchange.site_features import Point

Matrix = tuple[float, float, float, float, float, float]
"""a b c d e f of SVG: x' = a x + c y + e, y' = b x + d y + f."""

_SAME: Final[Matrix] = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
_DEEPEST = 64
_MOST_ELEMENTS = 20_000
_LONGEST_TRANSFORM = 1000
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_TRANSFORM = re.compile(r"\s*,?\s*([a-zA-Z]+)\s*\(([^)]*)\)\s*")
_PATH = re.compile(r"\s*,?\s*(?:([a-zA-Z])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))")
_DRAWN: Final = {"polygon", "polyline", "line", "rect", "path", "circle", "ellipse"}
_NEVER: Final = {"defs", "symbol", "clipPath", "mask", "pattern", "marker", "metadata", "namedview"}


@dataclass(frozen=True, slots=True)
class Shape:
    """A shape in a group that is read: its points in metres, y up."""

    kind: str
    points: tuple[Point, ...]
    closed: bool
    data: dict[str, str]
    where: str


@dataclass(slots=True)
class Drawing:
    """What was found in a document."""

    root: dict[str, str] = field(default_factory=dict)
    shapes: list[Shape] = field(default_factory=list)
    left_out: int = 0
    """Shapes in no group that is read."""


@dataclass(frozen=True, slots=True)
class _Open:
    """An element that is not closed yet: what holds inside it."""

    matrix: Matrix
    kind: str | None
    hidden: bool


def read_shapes(text: str, origin: str, groups: dict[str, str], unit: str, metres_per_unit: float | None) -> Drawing:
    """Return the shapes of an SVG document in metres, y up.

    Args:
        text: the document.
        origin: names it in errors.
        groups: kinds of shapes by the `id` or Inkscape label of their group.
        unit: the attribute of the document that says how many metres one user unit is.
        metres_per_unit: the same, said by whoever reads it.

    Raises:
        SiteError: it is no SVG, is not to scale, or a shape in one of the groups is not straight.
    """
    reader = _Reader(origin, groups, unit, metres_per_unit)
    parser = ParserCreate(namespace_separator=" ")
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    parser.EntityDeclHandler = reader.refuse_entity
    try:
        parser.Parse(text.encode(), True)
    except (ExpatError, ValueError) as problem:
        raise SiteError(f"{origin} is no SVG that can be read: {str(problem)[:100]}") from problem
    return reader.drawing


class _Reader:
    def __init__(self, origin: str, groups: dict[str, str], unit: str, metres_per_unit: float | None) -> None:
        self.drawing = Drawing()
        self._origin, self._groups, self._unit, self._scale = origin, groups, unit, metres_per_unit
        self._open: list[_Open] = []
        self._count = 0

    def refuse_entity(self, *_: object) -> NoReturn:
        self._refuse("it declares entities, which are not read", "save it as plain SVG")

    def start(self, tag: str, given: dict[str, str]) -> None:
        name = tag.rpartition(" ")[2]
        self._count += 1
        if not self._open:
            self._begin(name, given)
        if len(self._open) >= _DEEPEST or self._count > _MOST_ELEMENTS:
            self._refuse(f"it has more than {_MOST_ELEMENTS:,} elements, or is nested deeper than {_DEEPEST}")
        around = self._open[-1] if self._open else _Open(_SAME, None, False)
        matrix = _times(around.matrix, self._transform(given.get("transform", "")))
        labels = [given.get("data-kind"), given.get("id"), *(v for k, v in given.items() if k.endswith(" label"))]
        named = [self._groups.get(str(label).lower()) for label in labels if label] if name in ("g", "svg") else []
        kind = next(filter(None, named), around.kind)
        hidden = around.hidden or name in _NEVER
        self._open.append(_Open(matrix, kind, hidden))
        if name not in _DRAWN and not (name == "use" and kind):
            return
        if hidden or kind is None:
            self.drawing.left_out += not hidden
            return
        label = given.get("data-name") or given.get("data-id") or given.get("data-number") or given.get("id") or ""
        where = f"{kind} {label}".strip()[:60] if label else f"{kind} (element {self._count})"
        points, closed = self._points(name, given, where)
        metres = self._scale or 1.0
        placed = tuple(_tidy(_moved(matrix, point), metres) for point in points)
        if not all(math.isfinite(value) for point in placed for value in point):
            self._refuse(f"{where}: its coordinates are no numbers")
        data = {key[5:]: value for key, value in given.items() if key.startswith("data-") and key != "data-kind"}
        self.drawing.shapes.append(Shape(kind, placed, closed, data, where))

    def end(self, _: str) -> None:
        self._open.pop()

    def _begin(self, name: str, given: dict[str, str]) -> None:
        if name != "svg":
            self._refuse(f"it is no SVG, its outermost element is {name[:40]}")
        self.drawing.root = given
        if self._scale is None:
            said = given.get(self._unit, "")
            if not _NUMBER.fullmatch(said) or not 1e-6 <= float(said) <= 1e3:
                self._refuse("it does not say how many metres one of its units is", "say --metres-per-unit")
            self._scale = float(said)

    def _points(self, name: str, given: dict[str, str], where: str) -> tuple[list[Point], bool]:
        def number(key: str) -> float:
            text = given.get(key, "0").strip()
            if not _NUMBER.fullmatch(text):
                self._refuse(f"{where}: {key} is {text[:20]!r}, no plain number")
            return float(text)

        if name == "line":
            return [(number("x1"), number("y1")), (number("x2"), number("y2"))], False
        if name == "circle":
            return [(number("cx"), number("cy"))], False
        if name == "rect":
            x, y, wide, tall = (number(key) for key in ("x", "y", "width", "height"))
            return [(x, y), (x + wide, y), (x + wide, y + tall), (x, y + tall)], True
        if name == "path":
            return self._path(given.get("d", ""), where)
        if name not in ("polygon", "polyline"):
            self._refuse(f"{where}: a {name} is not read", "draw straight lines, polygons or rectangles")
        flat = [float(each) for each in _NUMBER.findall(given.get("points", ""))]
        if len(flat) < 4 or len(flat) % 2:
            self._refuse(f"{where}: its points are no pairs of numbers")
        return list(zip(flat[::2], flat[1::2], strict=True)), name == "polygon"

    def _path(self, text: str, where: str) -> tuple[list[Point], bool]:
        points: list[Point] = []
        command, closed, at, values = "", False, 0, list[float]()
        x, y = 0.0, 0.0
        text = text.rstrip()
        while at < len(text):
            token = _PATH.match(text, at)
            if token is None or closed:
                self._refuse(f"{where}: its path is no single outline or line of straight pieces")
            at = token.end()
            if token[1]:
                command = token[1]
                closed = command in "Zz"
                if command not in "MmLlHhVvZz" or values or (command in "Mm" and points):
                    self._refuse(f"{where}: its path is curved or in parts", "draw one line of straight pieces")
                continue
            values.append(float(token[2]))
            if not command or (command in "MmLl" and len(values) < 2):
                continue
            base_x, base_y = (x, y) if command.islower() else (0.0, 0.0)
            if command in "Hh":
                x = base_x + values[0]
            elif command in "Vv":
                y = base_y + values[0]
            else:
                x, y = base_x + values[0], base_y + values[1]
            points.append((x, y))
            values = []
        if values or len(points) < 2:
            self._refuse(f"{where}: its path has fewer than two points")
        return points, closed

    def _transform(self, text: str) -> Matrix:
        matrix, at = _SAME, 0
        while text[at:].strip():
            found = _TRANSFORM.match(text, at) if len(text) < _LONGEST_TRANSFORM else None
            values = [float(each) for each in _NUMBER.findall(found[2])] if found else []
            step = _step(found[1], values) if found else None
            if found is None or step is None:
                self._refuse(f"transform {text[:40]!r} is not read", "matrix, translate, scale and rotate are")
            matrix, at = _times(matrix, step), found.end()
        return matrix

    def _refuse(self, problem: str, advice: str = "") -> NoReturn:
        raise SiteError(f"{self._origin}: {problem}", advice=advice)


def _step(name: str, values: list[float]) -> Matrix | None:
    match name, values:
        case "matrix", [a, b, c, d, e, f]:
            return (a, b, c, d, e, f)
        case "translate", [x, *rest] if len(rest) < 2:
            return (1.0, 0.0, 0.0, 1.0, x, rest[0] if rest else 0.0)
        case "scale", [x, *rest] if len(rest) < 2:
            return (x, 0.0, 0.0, rest[0] if rest else x, 0.0, 0.0)
        case "rotate", [degrees, *centre] if len(centre) in (0, 2):
            cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            x, y = centre or (0.0, 0.0)
            return (cos, sin, -sin, cos, x - cos * x + sin * y, y - sin * x - cos * y)
    return None


def _times(outer: Matrix, inner: Matrix) -> Matrix:
    a, b, c, d, e, f = outer
    g, h, i, j, k, m = inner
    return (a * g + c * h, b * g + d * h, a * i + c * j, b * i + d * j, a * k + c * m + e, b * k + d * m + f)


def _moved(matrix: Matrix, point: Point) -> Point:
    a, b, c, d, e, f = matrix
    return (a * point[0] + c * point[1] + e, b * point[0] + d * point[1] + f)


def _tidy(point: Point, metres: float) -> Point:
    """Return a point of the drawing in the site's frame, without the noise of the transforms."""
    return tuple(near if abs(value - (near := round(value, 6))) < 1e-9 else value for value in _up(point, metres))  # type: ignore[return-value]


def _up(point: Point, metres: float) -> Point:
    return (point[0] * metres + 0.0, -point[1] * metres + 0.0)
