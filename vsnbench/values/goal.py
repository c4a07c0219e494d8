"""Goal of an episode, as a policy receives it: a string with a kind, words and perhaps a photograph."""

from enum import StrEnum
from typing import Any, Self

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


class Goal(str):
    """A goal. It is a string, so that a policy written for category words needs no change.

    The string is the category of a category goal, the words of a text or instruction goal, and the id of an image goal.
    """

    __slots__ = ("category", "id", "image", "kind", "text")

    id: str
    """Name of the goal at the site."""
    kind: GoalKind
    text: str
    """Words of a text or instruction goal; the category in words of a category goal; else empty."""
    category: str
    """Category of a category goal; else empty."""
    image: npt.NDArray[np.uint8] | None
    """(H, W, 3) RGB, read-only: the photograph of an image goal; else None."""

    def __new__(
        cls,
        id: str,  # noqa: A002 - the name that site files use
        kind: GoalKind = GoalKind.CATEGORY,
        *,
        text: str = "",
        category: str = "",
        image: npt.NDArray[np.uint8] | None = None,
    ) -> Self:
        """Make a goal.

        Args:
            id: name of the goal at the site.
            kind: how the goal is described.
            text: words; required for text and instruction goals.
            category: category of a category goal; by default the id.
            image: (H, W, 3) photograph; required for image goals.

        Raises:
            ValueError: the kind lacks what describes it.
        """
        kind = GoalKind(kind)
        if kind is GoalKind.CATEGORY:
            category = category or id
            text = text or category.replace("_", " ")
        value = {GoalKind.CATEGORY: category, GoalKind.IMAGE: id}.get(kind, text)
        if not value:
            raise ValueError(f"a goal of kind {kind} needs {'an id' if kind is GoalKind.IMAGE else 'words'}")
        if kind is GoalKind.IMAGE:
            image = _checked(image)
        goal = super().__new__(cls, value)
        for name, content in (("id", id), ("kind", kind), ("text", text), ("category", category), ("image", image)):
            object.__setattr__(goal, name, content)
        return goal

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a goal is read-only: {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return _remake, (self.id, self.kind, self.text, self.category, self.image)

    def __repr__(self) -> str:
        return f"Goal({self.id!r}, {self.kind.value!r}, {str(self)!r})"


def _remake(name: str, kind: GoalKind, text: str, category: str, image: npt.NDArray[np.uint8] | None) -> Goal:
    return Goal(name, kind, text=text, category=category, image=image)


def _checked(image: npt.NDArray[np.uint8] | None) -> npt.NDArray[np.uint8]:
    if image is None or image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or not image.size:
        raise ValueError("a goal of kind image needs a photograph of shape (H, W, 3) with 8 bits")
    image = image.view()
    image.flags.writeable = False
    return image
