"""Counting of how well a detector recognises goals: recall, false detections, confusions."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from benchmarks.support.coco_network import Box, Found, overlap, shared_area
from benchmarks.support.goal_views import CLASS_OF_CATEGORY, Extent, Visible

LEAST_SCORE = 0.25
LEAST_OVERLAP = 0.3
NOTHING = "nothing"
"""What a missed goal is called if no box of any class overlaps it."""
_BUILDING = "building"


@dataclass(frozen=True, slots=True)
class Recognition:
    """What a detector found in a view."""

    goal: str | None
    """Goal category; None in a view without goals."""
    extent: Extent | None
    called: str
    """Class of the box that overlaps the goal: its own class if any box has it, otherwise that of the best score."""
    false: tuple[tuple[str, str], ...]
    """False goal detections: COCO class, and what covers most of the box."""

    @property
    def recognised(self) -> bool:
        return self.goal is not None and self.called == CLASS_OF_CATEGORY[self.goal]


def recognise(
    objects: Sequence[Visible], goal: Visible | None, extent: Extent | None, found: Iterable[Found]
) -> Recognition:
    """Compare the boxes in a view with its visible objects."""
    boxes = sorted((item for item in found if item.score >= LEAST_SCORE), key=lambda item: -item.score)
    called = NOTHING
    if goal is not None:
        labels = [item.label for item in boxes if overlap(item.box, goal.box) >= LEAST_OVERLAP]
        own = CLASS_OF_CATEGORY[goal.category]
        called = own if own in labels else next(iter(labels), NOTHING)
    false = tuple((item.label, shown_in(item.box, objects)) for item in boxes if is_false(item, objects))
    return Recognition(goal.category if goal else None, extent, called, false)


def is_false(item: Found, objects: Iterable[Visible]) -> bool:
    """Return whether a box has a goal's class and overlaps no visible object of this class."""
    if item.label not in CLASS_OF_CATEGORY.values():
        return False
    same = (thing for thing in objects if CLASS_OF_CATEGORY.get(thing.category) == item.label)
    return all(overlap(item.box, thing.box) < LEAST_OVERLAP for thing in same)


def shown_in(box: Box, objects: Iterable[Visible]) -> str:
    """Return the category of the object that covers most of a box, or `building` if none covers half of it."""
    area = (box[2] - box[0]) * (box[3] - box[1])
    best = max(objects, key=lambda thing: shared_area(box, thing.box), default=None)
    return best.category if best and shared_area(box, best.box) >= area / 2 else _BUILDING


@dataclass(frozen=True, slots=True)
class Recall:
    """Recall of a category in views of one extent."""

    views: int
    recognised: int

    @property
    def share(self) -> float:
        return self.recognised / self.views if self.views else float("nan")


def recall(rows: Iterable[Recognition], category: str, extent: Extent) -> Recall:
    """Return the recall of a category."""
    own = [row for row in rows if row.goal == category and row.extent == extent]
    return Recall(len(own), sum(row.recognised for row in own))


def confusions(rows: Iterable[Recognition], category: str) -> Counter[str]:
    """Return what the detector calls the missed goals of a category."""
    return Counter(row.called for row in rows if row.goal == category and not row.recognised)


def false_per_image(rows: Sequence[Recognition]) -> float:
    """Return the false goal detections per image."""
    return sum(len(row.false) for row in rows) / len(rows) if rows else float("nan")


def false_kinds(rows: Iterable[Recognition]) -> Counter[tuple[str, str]]:
    """Return the false detections by class and by the category of what they show."""
    return Counter(kind for row in rows for kind in row.false)
