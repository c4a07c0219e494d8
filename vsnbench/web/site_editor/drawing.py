"""A site's floor plan as SVG, styled by the classes of its elements."""

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.sites.geometry.walls import bounds_of, lowest_first, wall_shapes
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of
from vsnbench.text.sanitize import sanitize

MARGIN_M = 0.25
_POINT_M = 0.15
"""Radius at which a point is drawn."""


def plan_svg(site: Site) -> str:
    """Return the plan: rooms, walls with openings, objects, numbered starting positions, and places of goals.

    The points and regions of goals have the class `goal-place`, and in `data-id` the ids of the goal and the target.
    The group `g.plan` uses the site's frame, metres with y up. A page can add elements to it.
    """
    x_min, y_min, x_max, y_max = bounds_of(site)
    width, height = x_max - x_min + 2 * MARGIN_M, y_max - y_min + 2 * MARGIN_M
    view = f"{x_min - MARGIN_M:.3f} {-y_max - MARGIN_M:.3f} {width:.3f} {height:.3f}"
    title = sanitize(f"floor plan of {site.title or site.name}")  # XML forbids control characters
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" role="img" aria-label={quoteattr(title)}>',
        '<g class="plan" transform="scale(1,-1)">',
    ]
    parts += [_area("room", [room.shape]) for room in site.rooms]
    for item in lowest_first(site):
        parts.append(_area(f"object {'solid' if item.solid else 'flat'}", [item.shape], item.category, item.id))
    for goal in site.goals:
        for target in targets_of(site, goal.id):
            if target.thing is None:
                shape = target.shape if target.is_region else target.shape.buffer(_POINT_M)
                parts.append(_area("goal-place", [shape], goal.id, f"{goal.id} {target.id}"))
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


def _area(css_class: str, shapes: Iterable[BaseGeometry], title: str = "", name: str = "") -> str:
    rings = [ring for shape in shapes for ring in shapely.get_rings(shapely.get_parts(shape))]
    path = "".join(f"M{'L'.join(f'{x:.3f} {y:.3f}' for x, y in ring.coords)}Z" for ring in rings)
    title_element = f"<title>{escape(sanitize(title))}</title>" if title else ""
    data = f" data-id={quoteattr(name)}" if name else ""
    return f'<path class="{css_class}"{data} fill-rule="evenodd" d="{path}">{title_element}</path>'


def _text(css_class: str, x: float, y: float, text: str) -> str:
    transform = f"translate({x:.3f} {y:.3f}) scale(1 -1)"
    return f'<text class="{css_class}" transform="{transform}">{escape(sanitize(text))}</text>'
