"""What a policy answers: an action, the model's own word for it, and diagnostics that no rule depends on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.actions import Action


@dataclass(frozen=True, slots=True)
class Box:
    """A detection in the image: pixel edges, label and score in [0, 1]."""

    left: float
    top: float
    right: float
    bottom: float
    label: str
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class GridMap:
    """A top-down map in the frame of the episode's start.

    `cells[row, column]` covers the square whose lower-left corner is
    (origin_x_m + column * resolution_m, origin_y_m + row * resolution_m).
    """

    cells: npt.NDArray[np.uint8]
    """(rows, columns): 0 unknown, 1 free, 2 occupied."""
    origin_x_m: float
    origin_y_m: float
    resolution_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostics:
    """What a policy wants shown beside its decision; everything is optional, points are in the start's frame."""

    probabilities: Mapping[str, float] = field(default_factory=dict)
    boxes: tuple[Box, ...] = ()
    map: GridMap | None = None
    sub_goal: tuple[float, float] | None = None
    path: tuple[tuple[float, float], ...] = ()
    nodes: tuple[tuple[float, float], ...] = ()
    scalars: Mapping[str, float] = field(default_factory=dict)
    note: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    """JSON-serialisable; kept in the record."""


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """The answer of a policy to one observation."""

    action: Action
    raw_action: str = ""
    """The model's own name for what it chose (e.g. LOOK_UP); the action's name when it has none."""
    diagnostics: Diagnostics = field(default_factory=Diagnostics)

    def __post_init__(self) -> None:
        # What is no action is refused by `checked_decision`, in words.
        if not self.raw_action and isinstance(self.action, Action):
            object.__setattr__(self, "raw_action", self.action.value)
