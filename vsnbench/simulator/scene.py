"""Conversion of a site to the primitives of physics and rasterizer."""

import math
from collections.abc import Iterator, Sequence

import shapely
from shapely import affinity

from vsnbench.simulator.building import build_structure, rectangles, site_bounds
from vsnbench.simulator.furniture import furnish, is_extruded, plain_color
from vsnbench.simulator.furniture.canvas import multiply, rgb, turn
from vsnbench.simulator.furniture.tableware import things_on
from vsnbench.simulator.primitives import Material, Primitive, Scene, Shape
from vsnbench.sites.site import Site, SiteObject
from vsnbench.values.pose import Pose

_UNSEEN = Material((1.0, 1.0, 1.0))
_NEVER_FELT = ("rug", "picture")
_TABLEWARE = "tableware"


def build_scene(site: Site, *, is_surveyed_only: bool = False) -> Scene:
    """Build a site's floors, walls, doorways, windows and furniture.

    Args:
        site: the site.
        is_surveyed_only: leave out the things on tables, which are not in the survey.

    Coverings, skirting and casings are visible but not solid. The slab under the floors and surveyed outlines are solid
    but not visible.

    Raises:
        SiteError: an object's model is unknown.
    """
    primitives = list(build_structure(site))
    for index, thing in enumerate(site.objects):
        primitives.extend(_stand(thing, index + 1))
        if not is_surveyed_only:
            primitives.extend(_laid_on(thing, site.objects))
    return Scene(tuple(primitives), site_bounds(site), site.ceiling_height_m)


def _stand(thing: SiteObject, instance: int) -> Iterator[Primitive]:
    """Yield an object's parts in the site's frame; an object with a surveyed outline collides as that outline."""
    yaw = math.radians(thing.heading_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    heading = turn((0, 0, 1), yaw)
    outlined = thing.footprint is not None
    solid = thing.solid and thing.category not in _NEVER_FELT
    for part in furnish(thing):
        x, y, z = part.centre
        yield Primitive(
            part.shape,
            (
                thing.position[0] + cos * x - sin * y,
                thing.position[1] + sin * x + cos * y,
                thing.elevation_m + z,
            ),
            part.half_size,
            part.material,
            multiply(heading, part.rotation),
            thing.category,
            instance,
            solid=solid and part.solid and not outlined,
            taper=part.taper,
            bevel_m=part.bevel_m,
        )
    if is_extruded(thing):
        yield from _extruded(thing, instance, Material(rgb(plain_color(thing))), visible=True, solid=solid)
    elif outlined and solid:
        yield from _extruded(thing, instance, _UNSEEN, visible=False, solid=True)


def _laid_on(table: SiteObject, objects: Sequence[SiteObject]) -> Iterator[Primitive]:
    """Yield the things on a table, without a contact; where another object covers the table's top there are none."""
    top_m = table.elevation_m + table.size_m[2]
    laid = things_on(table)
    if not laid:
        return
    taken = shapely.union_all(
        [
            other.shape.buffer(0.02)
            for other in objects
            if other is not table and other.elevation_m < top_m + 0.3 and other.elevation_m + other.size_m[2] > top_m
        ]
    )
    yaw = math.radians(table.heading_deg)
    at = Pose(*table.position, yaw)
    for group in laid:
        places = [at.compose(Pose(part.centre[0], part.centre[1])) for part in group]
        if any(taken.contains(shapely.Point(place.position)) for place in places):
            continue
        for part, place in zip(group, places, strict=True):
            yield Primitive(
                part.shape,
                (*place.position, top_m + part.centre[2]),
                part.half_size,
                part.material,
                multiply(turn((0, 0, 1), yaw), part.rotation),
                _TABLEWARE,
                solid=False,
                taper=part.taper,
                bevel_m=part.bevel_m,
            )


def _extruded(
    thing: SiteObject, instance: int, material: Material, *, visible: bool, solid: bool
) -> Iterator[Primitive]:
    """Yield the surveyed outline as boxes inside the outline."""
    yaw = math.radians(thing.heading_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    px, py = thing.position
    upright = affinity.rotate(affinity.translate(thing.shape, -px, -py), -thing.heading_deg, origin=(0, 0))
    height = thing.size_m[2]
    for x0, y0, x1, y1 in rectangles(upright, inscribed=True):
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        yield Primitive(
            Shape.BOX,
            (px + cos * x - sin * y, py + sin * x + cos * y, thing.elevation_m + height / 2),
            ((x1 - x0) / 2, (y1 - y0) / 2, height / 2),
            material,
            turn((0, 0, 1), yaw),
            thing.category,
            instance,
            solid=solid,
            visible=visible,
        )
