"""From a site to the list of primitives that physics and rasteriser share."""

import math
from collections.abc import Iterator

from shapely import affinity

from vsnbench.protocol.site import Site, SiteObject
from vsnbench.simulator.building import build_structure, rectangles, site_bounds
from vsnbench.simulator.furniture import furnish
from vsnbench.simulator.furniture.canvas import multiply, turn
from vsnbench.simulator.primitives import Material, Primitive, Scene, Shape

_UNSEEN = Material((1.0, 1.0, 1.0))
_NEVER_FELT = ("rug", "picture")


def build_scene(site: Site) -> Scene:
    """Build a site's floors, walls, doorways, windows and furniture.

    What is `solid` and what is `visible` differ: coverings, skirting and casings are only seen, the slab under the
    floors and a surveyed outline are only felt.

    Raises:
        SiteError: an object's category or model is unknown.
    """
    primitives = list(build_structure(site))
    for index, thing in enumerate(site.objects):
        primitives.extend(_stand(thing, index + 1))
    return Scene(tuple(primitives), site_bounds(site), site.ceiling_height_m)


def _stand(thing: SiteObject, instance: int) -> Iterator[Primitive]:
    """Put an object's parts where it stands; those of a surveyed outline collide as that outline."""
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
            solid=solid and not outlined,
        )
    if outlined and solid:
        yield from _extruded(thing, instance)


def _extruded(thing: SiteObject, instance: int) -> Iterator[Primitive]:
    """The surveyed outline as boxes that are felt and not seen; they never reach outside of it."""
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
            _UNSEEN,
            turn((0, 0, 1), yaw),
            thing.category,
            instance,
            visible=False,
        )
