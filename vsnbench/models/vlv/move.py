"""An action of the search, with the reason for it."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from vsnbench.models.vlv.planner import Point
from vsnbench.values.action import Action


class Mode(StrEnum):
    """Activity of the policy."""

    SCAN = "scan"
    TRAVEL = "travel"
    SEEK = "seek"
    STOP = "stop"


@dataclass(frozen=True, slots=True, eq=False)
class SearchStep:
    """An action and the reason for it."""

    action: Action
    mode: Mode
    note: str
    sub_goal: Point | None = None
    path: tuple[Point, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)
