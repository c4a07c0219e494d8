"""Goal of an episode, as a policy receives it: a string with a kind, words, photographs or a point."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt


class GoalKind(StrEnum):
    """How a goal is described to a policy."""

    CATEGORY = "category"
    """A category word, such as `chair`."""
    TEXT = "text"
    """Free words, such as `the red armchair by the window`."""
    IMAGE = "image"
    """A photograph of the goal."""
    INSTRUCTION = "instruction"
    """A route in words, from named starting positions only."""
    POINT = "point"
    """A position on the floor, in the frame of the start."""
    ROUTE = "route"
    """Photographs along a way, in order; the last one shows the goal."""
    SEQUENCE = "sequence"
    """Goals of the other kinds, given one after the other. On a model's card: it keeps its memory from one to the next
    (`Policy.next_goal`)."""


class Goal(str):
    """A goal. It is a string, so that a policy written for category words needs no change.

    The string is the category of a category goal, the words of a text or instruction goal, and the id of any other.
    """

    __slots__ = ("category", "id", "image", "images", "kind", "point", "text")

    id: str
    """Name of the goal at the site."""
    kind: GoalKind
    text: str
    """Words of a text or instruction goal; the category in words of a category goal; else empty."""
    category: str
    """Category of a category goal; else empty."""
    image: npt.NDArray[np.uint8] | None
    """(H, W, 3) RGB, read-only: the photograph of an image goal; else None."""
    images: tuple[npt.NDArray[np.uint8], ...]
    """(H, W, 3) RGB each, read-only: the photographs of a route, in order; else empty."""
    point: tuple[float, float] | None
    """x forward and y to the left, metres, of a point goal, in the frame of `Observation.pose`: that of the episode's
    start, also for later goals of a sequence; else None."""

    def __new__(
        cls,
        id: str,  # noqa: A002 - the name that site files use
        kind: GoalKind = GoalKind.CATEGORY,
        *,
        text: str = "",
        category: str = "",
        image: npt.NDArray[np.uint8] | None = None,
        images: Sequence[npt.NDArray[np.uint8]] = (),
        point: tuple[float, float] | None = None,
    ) -> Self:
        """Make a goal.

        Args:
            id: name of the goal at the site.
            kind: how the goal is described.
            text: words; required for text and instruction goals.
            category: category of a category goal; by default the id.
            image: (H, W, 3) photograph; required for image goals.
            images: (H, W, 3) photographs, two or more; required for routes.
            point: x and y in the frame of the start, metres; required for point goals.

        Raises:
            ValueError: the kind lacks what describes it, or is `sequence`: a policy receives its goals one by one.
        """
        kind = GoalKind(kind)
        if kind is GoalKind.SEQUENCE:
            raise ValueError("a policy receives the goals of a sequence one by one")
        if kind is GoalKind.CATEGORY:
            category = category or id
            text = text or category.replace("_", " ")
        has_words = kind in (GoalKind.TEXT, GoalKind.INSTRUCTION)
        value = category if kind is GoalKind.CATEGORY else text if has_words else id
        if not value:
            raise ValueError(f"a goal of kind {kind} needs {'words' if has_words else 'an id'}")
        if kind is GoalKind.IMAGE:
            image = _checked(image, kind)
        if kind is GoalKind.ROUTE and len(images) < LEAST_PHOTOGRAPHS:
            raise ValueError(f"a route needs {LEAST_PHOTOGRAPHS} photographs or more")
        if kind is GoalKind.POINT and (point is None or not all(map(math.isfinite, point))):
            raise ValueError("a goal of kind point needs x and y in metres")
        goal = super().__new__(cls, value)
        fields = {"id": id, "kind": kind, "text": text, "category": category, "image": image, "point": point}
        for name, content in {**fields, "images": tuple(_checked(item, kind) for item in images)}.items():
            object.__setattr__(goal, name, content)
        return goal

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a goal is read-only: {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return _remake, tuple(getattr(self, name) for name in _PARTS)

    def __repr__(self) -> str:
        return f"Goal({self.id!r}, {self.kind.value!r}, {str(self)!r})"


LEAST_PHOTOGRAPHS: Final = 2
"""A route of one photograph is an image goal."""
_PARTS = ("id", "kind", "text", "category", "image", "images", "point")


def _remake(*values: Any) -> Goal:
    given = dict(zip(_PARTS, values, strict=True))
    return Goal(given.pop("id"), given.pop("kind"), **given)


def _checked(image: npt.NDArray[np.uint8] | None, kind: GoalKind) -> npt.NDArray[np.uint8]:
    if image is None or image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or not image.size:
        raise ValueError(f"a goal of kind {kind} needs photographs of shape (H, W, 3) with 8 bits")
    image = image.view()
    image.flags.writeable = False
    return image
