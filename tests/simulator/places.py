"""Small worlds for tests of the physics and of the simulated robot."""

from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.primitives import Material, Primitive, Scene, Shape
from vsnbench.sites.site import Room, Site, SiteObject, StartingPosition, Wall
from vsnbench.values.robot_profile import RobotProfile

GREY = Material((0.5, 0.5, 0.5))


def turtlebot2() -> RobotProfile:
    """Return the profile that most tests drive."""
    return load_profile("turtlebot2")


def square_room(
    side_m: float, *objects: SiteObject, start: tuple[float, float] | None = None, heading_deg: float = 0.0
) -> Site:
    """Return a site of one square room with one starting position, in its middle when not given."""
    corners = [(0.0, 0.0), (side_m, 0.0), (side_m, side_m), (0.0, side_m)]
    return Site(
        name="square",
        rooms=[Room(name="hall", polygon=corners)],
        walls=[Wall(start=corners[k], end=corners[(k + 1) % 4]) for k in range(4)],
        objects=list(objects),
        starts=[
            StartingPosition(number=1, position=start or (side_m / 2, side_m / 2), heading_deg=heading_deg),
        ],
    )


def scene_of(*primitives: Primitive) -> Scene:
    """Return a scene of those primitives on the bare floor."""
    return Scene(primitives, (-50.0, -50.0, 50.0, 50.0), 2.5)


def pillar(x_m: float, y_m: float, half_m: float = 0.1, *, bottom_m: float = 0.0, top_m: float = 1.0) -> Primitive:
    """Return a square pillar."""
    half_height_m = (top_m - bottom_m) / 2
    return Primitive(
        Shape.BOX,
        (x_m, y_m, bottom_m + half_height_m),
        (half_m, half_m, half_height_m),
        GREY,
        category="cabinet",
        instance=1,
    )
