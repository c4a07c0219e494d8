"""Decision of a policy: an action or a movement, the model's own name for it, and diagnostics that affect no rule."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from vsnbench.values.movement import Action, ActionKind, Chunk, Movement, action_of


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
    """Top-down map in the frame of the episode's start.

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
    """Data of a policy to show with its decision; all fields are optional, points are in the start's frame."""

    probabilities: Mapping[str, float] = field(default_factory=dict)
    boxes: tuple[Box, ...] = ()
    map: GridMap | None = None
    sub_goal: tuple[float, float] | None = None
    path: tuple[tuple[float, float], ...] = ()
    nodes: tuple[tuple[float, float], ...] = ()
    scalars: Mapping[str, float] = field(default_factory=dict)
    note: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    """JSON-serializable; recorded."""


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Decision of a policy for one observation.

    `Decision(Action.MOVE_FORWARD)`, `Decision(Waypoint(1.2, -0.3))` and `Decision(Chunk((...)))` are all accepted: a
    movement given as the action sets `movement`, and a chunk sets `parts`.
    """

    action: Action
    """For a movement, the action under which it is counted; for a chunk, that of its first part."""
    raw_action: str = ""
    """The model's own name of the action (e.g. LOOK_UP); default: the action's name."""
    diagnostics: Diagnostics = field(default_factory=Diagnostics)
    movement: Movement | None = None
    """Parameters of an action that has some."""
    parts: tuple[Action | Movement, ...] = ()
    """All parts of a chunk; empty for a single action."""

    if TYPE_CHECKING:

        def __init__(
            self,
            action: Action | Movement | Chunk,
            raw_action: str = "",
            diagnostics: Diagnostics = ...,
            movement: Movement | None = None,
            parts: tuple[Action | Movement, ...] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        # `checked_decision` rejects other types with a message.
        given: object = self.action
        if isinstance(given, Chunk) and given.parts:
            object.__setattr__(self, "parts", tuple(given.parts))
            given = self.parts[0]
        if isinstance(given, Movement):
            object.__setattr__(self, "movement", given)
            given = action_of(given)
        if isinstance(given, Action):
            object.__setattr__(self, "action", given)
            if not self.raw_action:
                object.__setattr__(self, "raw_action", given.value)

    @property
    def kinds(self) -> frozenset[ActionKind]:
        """Kinds of this answer; a chunk has its own and those of its parts."""
        if not self.parts:
            return frozenset({_kind(self.movement)})
        return frozenset({ActionKind.CHUNK, *(_kind(None if isinstance(p, Action) else p) for p in self.parts)})


def _kind(movement: Movement | None) -> ActionKind:
    return ActionKind.DISCRETE if movement is None else movement.kind
