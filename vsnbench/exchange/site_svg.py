"""Sites as SVG drawings, and back: plain shapes in groups for rooms, walls, doors, windows, objects and starts.

One user unit is a metre, y is turned around by the outermost group, and what a drawing cannot show is in `data-`
attributes by the names of a site file. A start is a line from where the robot stands to where it looks.
"""

import json
import math
from typing import Any, Final
from xml.sax.saxutils import escape, quoteattr

from vsnbench.exchange.site_features import HEAD, KINDS, Content, Feature, features_of, head_of
from vsnbench.exchange.svg_shapes import Shape, read_shapes
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.site import Site

UNIT = "data-metres-per-unit"
_TEXTS: Final = {"name", "title", "id", "category", "model", "color", "floor", "floor_color", "note"}
_STYLES: Final = {
    "room": "fill:#f4efe6;stroke:none",
    "wall": "fill:none;stroke:#333333;stroke-linecap:square",
    "door": "fill:none;stroke:#c8813a;stroke-width:0.06",
    "window": "fill:none;stroke:#5aa0d8;stroke-width:0.06",
    "object": "fill:#cccccc;fill-opacity:0.7;stroke:#555555;stroke-width:0.01",
    "start": "fill:none;stroke:#b01050;stroke-width:0.05;marker-start:url(#stands)",
}
_STANDS = (
    '<defs><marker id="stands" viewBox="-1 -1 2 2" markerWidth="3" markerHeight="3">'
    '<circle r="1" style="fill:#b01050;stroke:none"/></marker></defs>'
)
_GOAL_STYLE = "fill:#9ccf9c;fill-opacity:0.8;stroke:#2f6f2f;stroke-width:0.015"
_LOOK_M = 0.35
_MARGIN_M = 0.5
_SAME_DEG = 0.05


def site_svg(site: Site) -> str:
    """Return a site as an SVG document that drawing programs open, and `read_svg` reads."""
    features = features_of(site)
    corners = [point for feature in features for point in feature.points]
    left, right = (edge(x for x, _ in corners) for edge in (min, max))
    low, high = (edge(y for _, y in corners) for edge in (min, max))
    wide, tall = right - left + 2 * _MARGIN_M, high - low + 2 * _MARGIN_M
    head = "".join(f" data-{name}={_quoted(value)}" for name, value in head_of(site).items())
    root = (
        f'<svg xmlns="http://www.w3.org/2000/svg" {UNIT}="1"{head}'
        f' viewBox="{left - _MARGIN_M:.4g} {-high - _MARGIN_M:.4g} {wide:.4g} {tall:.4g}"'
        f' width="{wide * 20:.4g}mm" height="{tall * 20:.4g}mm">'
    )
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        root,
        f"<title>{escape(site.title or site.name)}, 1:50</title>",
        _STANDS,
        '<g transform="scale(1,-1)">',
    ]
    for kind, group in KINDS.items():
        lines.append(f'<g id="{group}" style="{_STYLES[kind]}">')
        lines += [_element(feature) for feature in features if feature.kind == kind]
        lines.append("</g>")
    return "\n".join([*lines, "</g>", "</svg>"]) + "\n"


def read_svg(text: str, origin: str, metres_per_unit: float | None) -> tuple[list[Feature], Content, int]:
    """Return what is drawn in the groups of an SVG document, what it says of the site, and how many shapes it leaves.

    Args:
        text: the document.
        origin: names it in errors.
        metres_per_unit: what one user unit is; None takes the document's word.

    Raises:
        SiteError: it is none, says no scale, or a shape in a group of ours cannot be read.
    """
    drawing = read_shapes(text, origin, dict(zip(KINDS.values(), KINDS, strict=True)), UNIT, metres_per_unit)
    head = {name: _value(name, drawing.root[f"data-{name}"]) for name in HEAD if f"data-{name}" in drawing.root}
    return [_feature(shape) for shape in drawing.shapes], head, drawing.left_out


def _element(feature: Feature) -> str:
    points, more = feature.points, ""
    if feature.kind == "start":
        (x_m, y_m), heading_rad = points[0], math.radians(feature.properties["heading_deg"])
        tip = (round(x_m + _LOOK_M * math.cos(heading_rad), 6), round(y_m + _LOOK_M * math.sin(heading_rad), 6))
        points = ((x_m, y_m), tip)
    if feature.kind == "wall":
        more = f' style="stroke-width:{feature.properties.get("thickness_m", 0.1):g}"'
    if feature.properties.get("category") in GOAL_CATEGORIES:
        more = f' style="{_GOAL_STYLE}"'
    data = "".join(f" data-{name}={_quoted(value)}" for name, value in feature.properties.items())
    shape = "polygon" if feature.closed else "polyline"
    return f'<{shape} points="{" ".join(f"{x_m!r},{y_m!r}" for x_m, y_m in points)}"{data}{more}/>'


def _quoted(value: object) -> str:
    return quoteattr(value if isinstance(value, str) else json.dumps(value))


def _feature(shape: Shape) -> Feature:
    given = {name: _value(name, text) for name, text in shape.data.items()}
    points = shape.points
    if shape.kind == "start" and len(points) == 2:
        (x_m, y_m), (ahead_m, aside_m) = points
        drawn_deg = math.degrees(math.atan2(aside_m - y_m, ahead_m - x_m))
        said = given.get("heading_deg")
        if not isinstance(said, int | float) or abs(math.remainder(said - drawn_deg, 360)) > _SAME_DEG:
            given["heading_deg"] = round(drawn_deg, 2)
        points = points[:1]
    return Feature(shape.kind, points, shape.closed, given, shape.where)


def _value(name: str, text: str) -> Any:
    if name in _TEXTS:
        return text
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
