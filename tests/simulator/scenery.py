"""A plain room to put things into, and every look that a thing can have."""

from vsnbench.simulator.furniture import MODELS
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall

LOOKS = [(category, model) for category, looks in MODELS.items() for model in looks]


def a_site(*objects: SiteObject, doors: tuple[Door, ...] = (), polygon: tuple[tuple[float, float], ...] = ()) -> Site:
    return Site(
        name="plain",
        rooms=[Room(name="hall", polygon=list(polygon or ((0, 0), (6, 0), (6, 4), (0, 4))))],
        walls=[
            Wall(start=(0, 0), end=(6, 0)),
            Wall(start=(6, 0), end=(6, 4)),
            Wall(start=(6, 4), end=(0, 4)),
            Wall(start=(0, 4), end=(0, 0)),
        ],
        doors=list(doors),
        objects=list(objects),
        starts=[StartingPosition(number=1, position=(1, 1), heading_deg=0)],
    )
