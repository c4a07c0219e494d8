"""Meaning of a goal's name at a site: the goal that a policy receives, and the targets that count as reached."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.errors import SiteError
from vsnbench.sites.categories import canonical_category
from vsnbench.sites.goals import GoalTarget
from vsnbench.sites.site import Site, SiteObject
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

REGION = "region:"
"""Prefix of the id of a region, which no object's id can have."""
POINT = "point:"


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """One thing that counts as reaching a goal."""

    id: str
    """Id of the object, or `point:` or `region:` with a name or number."""
    shape: "BaseGeometry"
    """Footprint of the object, the point, or the region; metres in the site's frame."""
    thing: SiteObject | None = None
    """The object, if it is one."""

    @property
    def is_region(self) -> bool:
        """Whether the base must be inside the shape; else STOP near it and in sight of it succeeds."""
        return self.id.startswith(REGION)


def targets_of(site: Site, name: str) -> tuple[Target, ...]:
    """Return the targets of a goal.

    Args:
        site: the site.
        name: id of a goal of the site file, or a category.

    Returns:
        The targets in the order of the site file, of all goals of a sequence; none if the site has no such goal.
    """
    goal = site.goal(name)
    if goal is None:
        return tuple(Target(thing.id, thing.shape, thing) for thing in site.instances(name))
    if goal.kind is GoalKind.SEQUENCE:
        each = {target.id: target for leg in goal.legs for target in targets_of(site, leg)}
        return tuple(each.values())
    found: dict[str, Target] = {}
    for number, target in enumerate(goal.meant, start=1):
        for resolved in _resolved(site, target, number):
            found.setdefault(resolved.id, resolved)
    return tuple(found.values())


def _resolved(site: Site, target: GoalTarget, number: int) -> Iterator[Target]:
    import shapely

    if target.object is not None:
        yield from (Target(thing.id, thing.shape, thing) for thing in site.objects if thing.id == target.object)
    elif target.category is not None:
        things = site.instances(canonical_category(target.category))
        yield from (Target(thing.id, thing.shape, thing) for thing in things)
    elif target.point is not None:
        yield Target(f"{POINT}{target.name or number}", shapely.Point(target.point))
    else:
        yield Target(f"{REGION}{target.name or number}", shapely.Polygon(target.region))


def legs_of(site: Site, name: str) -> tuple[str, ...]:
    """Return the goals that are given one after the other: those of a sequence, or the goal itself."""
    goal = site.goal(name)
    return (name,) if goal is None else goal.legs


def describe_goal(site: Site, name: str, start: Pose) -> Goal:
    """Return the goal of that name as a policy receives it whose episode began at a pose in the site's frame.

    Raises:
        SiteError: a photograph of an image goal or route is not available (`no-goal-image`).
        ValueError: the goal is a sequence.
    """
    goal = site.goal(name)
    if goal is None:
        return Goal(name)
    if goal.kind is GoalKind.CATEGORY:
        return Goal(goal.id, category=canonical_category(goal.category))
    if goal.kind is GoalKind.POINT and goal.targets[0].point is not None:
        there = Pose(*goal.targets[0].point).relative_to(start)
        return Goal(goal.id, goal.kind, point=there.position)
    photographs = [image for image in (goal.image, *goal.images) if image is not None]
    images = [image.pixels for image in photographs]
    available = [pixels for pixels in images if pixels is not None]
    if len(available) < len(images) or (goal.kind is GoalKind.IMAGE and not images):
        raise SiteError(
            f"goal {goal.id!r}: a photograph is not available",
            advice="load the site from its file, which names the image",
            code="no-goal-image",
        )
    if goal.kind is GoalKind.IMAGE:
        return Goal(goal.id, goal.kind, image=available[0])
    return Goal(goal.id, goal.kind, text=goal.text, images=available)


def kind_of(site: Site, name: str) -> GoalKind:
    """Return the kind of a goal; a category for a name that is not a goal of the site file."""
    goal = site.goal(name)
    return GoalKind.CATEGORY if goal is None else goal.kind


def goal_words(site: Site, name: str) -> str:
    """Return a goal for people: its name, the words of a text goal or an instruction, the goals of a sequence."""
    goal = site.goal(name)
    if goal is not None and goal.kind is GoalKind.SEQUENCE:
        return f"{name} ({', '.join(goal.legs)})"
    return f"{name} ({goal.text})" if goal is not None and goal.text else name


def reached_words(site: Site, name: str) -> str:
    """Return what a person measures the distance to: `nearest chair`, `sofa-1` or `edge of region:kitchen`."""
    if site.goal(name) is None:
        return f"nearest {name}"
    targets = [f"edge of {target.id}, 0 inside" if target.is_region else target.id for target in targets_of(site, name)]
    return targets[0] if len(targets) == 1 else f"nearest of {', '.join(targets)}"


def definition_sha256(site: Site, name: str) -> str:
    """Return the hash of a goal's definition; empty for a category, which the site's hash covers."""
    goal = site.goal(name)
    return "" if goal is None else goal.sha256
