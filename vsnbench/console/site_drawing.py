"""A site's floor plan as SVG for a page: metres, y upwards, classes for the style sheet and nothing inline."""

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.harmless_text import harmless
from vsnbench.protocol.site import Site
from vsnbench.protocol.walls import bounds_of, lowest_first, wall_shapes

MARGIN_M = 0.25


def plan_svg(site: Site) -> str:
    """Return the plan: rooms, walls with their openings, things, and the starting positions with their numbers.

    The whole is drawn in `g.plan`, in which x and y are the site's own, metres; a page may add to it.
    """
    x_min, y_min, x_max, y_max = bounds_of(site)
    width, height = x_max - x_min + 2 * MARGIN_M, y_max - y_min + 2 * MARGIN_M
    view = f"{x_min - MARGIN_M:.3f} {-y_max - MARGIN_M:.3f} {width:.3f} {height:.3f}"
    title = harmless(f"floor plan of {site.title or site.name}")  # XML has no place for control characters
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" role="img" aria-label={quoteattr(title)}>',
        '<g class="plan" transform="scale(1,-1)">',
    ]
    parts += [_area("room", [room.shape]) for room in site.rooms]
    for thing in lowest_first(site):
        parts.append(_area(f"thing {'solid' if thing.solid else 'flat'}", [thing.shape], thing.category))
    parts.append(_area("wall", [shapely.union_all(wall_shapes(site))]))
    parts += [_area("window", [window.centre_line.buffer(0.04, cap_style="flat")]) for window in site.windows]
    parts += [_area("door", [door.centre_line.buffer(0.03)]) for door in site.doors if door.closed]
    for room in site.rooms:
        x, y = shapely.point_on_surface(room.shape).coords[0]
        parts.append(_text("room-name", x, y, room.name))
    for start in site.starts:
        x, y = start.position
        parts.append(f'<circle class="start" cx="{x:.3f}" cy="{y:.3f}" r="0.17"/>')
        parts.append(_text("start-number", x, y - 0.07, str(start.number)))
    return "".join([*parts, "</g></svg>"])


def _area(name: str, shapes: Iterable[BaseGeometry], title: str = "") -> str:
    rings = [ring for shape in shapes for ring in shapely.get_rings(shapely.get_parts(shape))]
    path = "".join(f"M{'L'.join(f'{x:.3f} {y:.3f}' for x, y in ring.coords)}Z" for ring in rings)
    inside = f"<title>{escape(harmless(title))}</title>" if title else ""
    return f'<path class="{name}" fill-rule="evenodd" d="{path}">{inside}</path>'


def _text(name: str, x: float, y: float, words: str) -> str:
    return f'<text class="{name}" transform="translate({x:.3f} {y:.3f}) scale(1 -1)">{escape(harmless(words))}</text>'
