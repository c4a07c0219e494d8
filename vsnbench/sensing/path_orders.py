"""What drives a base along paths that replace each other is told, and what it reports; as JSON for the network.

The caller repeats its newest order all the time. An order that is lost does no harm, and a base whose caller falls
silent stops by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, Self

from vsnbench.errors import DecisionError
from vsnbench.values.decision_check import checked_movement
from vsnbench.values.encoding.codec import movement_from_json
from vsnbench.values.encoding.motion_answer import MOST_NAME, MOST_TEXT, number_in, text_in
from vsnbench.values.movement import Drive, Pixel
from vsnbench.values.pose import Pose

REPEAT_S: Final = 0.05
"""Period in which a caller repeats its order."""
SILENT_S: Final = 0.6
"""A caller that has not repeated its order for this long is gone: the base is commanded zero velocity."""


class PathEnd(StrEnum):
    """What an order without a movement asks for."""

    BRAKE = "brake"
    """Drop the path, and slow down within the accelerations of the base."""
    STOP = "stop"
    """Drop the path, and command zero velocity at once."""
    RELEASE = "release"
    """Command zero velocity, and steer the base no longer."""


@dataclass(frozen=True, slots=True)
class PathOrder:
    """The newest order of a caller."""

    caller: str
    """One episode of one caller; a failure ends all its orders."""
    number: int
    """A larger number replaces the order before it."""
    task: Drive | PathEnd
    origin: Pose | None = None
    """Pose in the frame of the odometry that a movement is relative to; None for the present pose."""
    leaves: int = 0
    """Number of the last request to leave rest that the caller has allowed; see `PathState.asks`."""

    def to_json(self) -> dict[str, Any]:
        """Return the order as JSON values."""
        task = {"end": self.task.value} if isinstance(self.task, PathEnd) else {"movement": self.task.to_json()}
        at = self.origin
        origin = {} if at is None else {"origin": {"x_m": at.x_m, "y_m": at.y_m, "heading_rad": at.heading_rad}}
        return {"caller": self.caller, "number": self.number, "leaves": self.leaves, **task, **origin}

    @classmethod
    def of(cls, content: object) -> Self:
        """Return the order in a message from the network.

        Raises:
            ValueError: it is not an order, or its movement is not one that can replace a running path.
        """
        if not isinstance(content, Mapping):
            raise ValueError("an order must be a map")  # noqa: TRY004  # a message, no argument
        caller = text_in(content, "caller", MOST_NAME)
        if not caller:
            raise ValueError("an order has no `caller`")
        task: Drive | PathEnd
        if (movement := content.get("movement")) is None:
            task = PathEnd(text_in(content, "end", MOST_NAME))
        else:
            try:
                checked = checked_movement(movement_from_json(movement))
            except DecisionError as error:
                raise ValueError(str(error)) from error
            if isinstance(checked, Pixel) or not checked.replaces_path:
                raise ValueError(f"a {checked.kind} cannot replace a running path")
            task = checked
        origin = None
        if (at := content.get("origin")) is not None:
            if not isinstance(at, Mapping):
                raise ValueError("`origin` must be a map")
            origin = Pose(*(number_in(at, key) for key in ("x_m", "y_m", "heading_rad")))
        return cls(caller, int(number_in(content, "number")), task, origin, int(number_in(content, "leaves", 0.0)))


@dataclass(frozen=True, slots=True)
class PathState:
    """What drives along paths reports."""

    caller: str = ""
    number: int = -1
    """The newest order that it has taken from this caller."""
    waits: bool = True
    """Whether the path has ended, and the base is commanded to rest."""
    remaining_m: float | None = None
    """Length of the path that is left; None if it is not known."""
    asks: int = 0
    """Number of requests to leave rest forwards: the caller looks whether the way is free, and allows it."""
    failure: str = ""
    """Why the base is not driven any more, or an empty string."""
    sensor_lost: bool = False
    """Whether missing or invalid odometry is the reason."""

    def to_json(self) -> dict[str, Any]:
        """Return the state as JSON values."""
        return {name: getattr(self, name) for name in self.__slots__}

    @classmethod
    def of(cls, content: object) -> Self:
        """Return the state in a message from the network.

        Raises:
            ValueError: it is not a state.
        """
        if not isinstance(content, Mapping):
            raise ValueError("a state must be a map")  # noqa: TRY004  # a message, no argument
        left_m = None if content.get("remaining_m") is None else number_in(content, "remaining_m")
        return cls(
            text_in(content, "caller", MOST_NAME),
            int(number_in(content, "number")),
            content.get("waits") is True,
            left_m,
            int(number_in(content, "asks", 0.0)),
            text_in(content, "failure", MOST_TEXT),
            content.get("sensor_lost") is True,
        )
