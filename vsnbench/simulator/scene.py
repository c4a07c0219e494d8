"""Conversion of a site to the primitives of physics and rasterizer."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace

import shapely
from shapely import affinity

from vsnbench.simulator.building import build_structure, rectangles, site_bounds
from vsnbench.simulator.furniture import furnish, is_extruded, plain_color
from vsnbench.simulator.furniture.canvas import multiply, rgb, turn
from vsnbench.simulator.furniture.tableware import things_on
from vsnbench.simulator.primitives import Material, Primitive, Scene, Shape
from vsnbench.sites.geometry.walls import top_m
from vsnbench.sites.site import Site, SiteObject
from vsnbench.values.pose import Pose

_UNSEEN = Material((1.0, 1.0, 1.0))
_NEVER_FELT = ("rug", "picture")
_built: deque[tuple[Site, bool, Scene]] = deque(maxlen=4)
"""The last scenes: the robots of a session and the replays of a verification stand in a few sites."""


def build_scene(site: Site, *, is_surveyed_only: bool = False) -> Scene:
    """Build a site's floors, walls, doorways, windows and furniture; equal sites have the same scene.

    Args:
        site: the site.
        is_surveyed_only: leave out the things on tables and the lights, which are not in the survey.

    Coverings, skirting and casings are visible but not solid. The slab under the floors and surveyed outlines are solid
    but not visible.

    Raises:
        SiteError: an object's model is unknown.
    """
    for known, known_as, scene in tuple(_built):
        if known_as == is_surveyed_only and (known is site or known == site):
            return scene
    primitives = list(build_structure(site, is_surveyed_only=is_surveyed_only))
    for index, thing in enumerate(site.objects):
        primitives.extend(_stand(thing, index + 1))
        if not is_surveyed_only:
            primitives.extend(_laid_on(thing, site.objects))
    labelled = () if site.scan is None else tuple(site.objects)
    scene = Scene(tuple(primitives), site_bounds(site), site.ceiling_height_m, site.scan, labelled)
    _built.append((site, is_surveyed_only, scene))
    return scene


def _stand(thing: SiteObject, instance: int) -> Iterator[Primitive]:
    """Yield an object's parts in the site's frame; an object with a surveyed outline collides as that outline."""
    outlined = thing.footprint is not None
    solid = thing.solid and thing.category not in _NEVER_FELT
    for part in furnish(thing):
        placed = _placed(part, thing.pose, thing.elevation_m, thing.category)
        yield replace(placed, instance=instance, solid=solid and part.solid and not outlined)
    if is_extruded(thing):
        yield from _extruded(thing, instance, Material(rgb(plain_color(thing))), visible=True, solid=solid)
    elif outlined and solid:
        yield from _extruded(thing, instance, _UNSEEN, visible=False, solid=True)


def _placed(part: Primitive, frame: Pose, elevation_m: float, category: str) -> Primitive:
    """Return a part in the site's frame; the object's frame has the pose `frame`."""
    x, y, z = part.centre
    centre = (*frame.compose(Pose(x, y)).position, elevation_m + z)
    return replace(
        part, centre=centre, rotation=multiply(turn((0, 0, 1), frame.heading_rad), part.rotation), category=category
    )


def _laid_on(table: SiteObject, objects: Sequence[SiteObject]) -> Iterator[Primitive]:
    """Yield the things on a table, without a contact; where another object covers the table's top there are none."""
    laid = things_on(table)
    if not laid:
        return
    taken = shapely.union_all(
        [
            other.shape.buffer(0.02)
            for other in objects
            if other is not table and other.elevation_m < top_m(table) + 0.3 and top_m(other) > top_m(table)
        ]
    )
    for group in laid:
        placed = [_placed(part, table.pose, top_m(table), "tableware") for part in group]
        if not any(taken.contains(shapely.Point(primitive.centre[:2])) for primitive in placed):
            yield from (replace(primitive, solid=False) for primitive in placed)


def _extruded(
    thing: SiteObject, instance: int, material: Material, *, visible: bool, solid: bool
) -> Iterator[Primitive]:
    """Yield the surveyed outline as boxes inside the outline."""
    px, py = thing.position
    upright = affinity.rotate(affinity.translate(thing.shape, -px, -py), -thing.heading_deg, origin=(0, 0))
    height = thing.size_m[2]
    for x0, y0, x1, y1 in rectangles(upright, inscribed=True):
        centre, half_size = ((x0 + x1) / 2, (y0 + y1) / 2, height / 2), ((x1 - x0) / 2, (y1 - y0) / 2, height / 2)
        part = Primitive(Shape.BOX, centre, half_size, material)
        placed = _placed(part, thing.pose, thing.elevation_m, thing.category)
        yield replace(placed, instance=instance, solid=solid, visible=visible)
