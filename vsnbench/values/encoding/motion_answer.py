"""What a program that executes movements states of itself and of a movement, as JSON (docs/motion-adapter.md).

The program is untrusted, as every peer.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, Self

from vsnbench.text.sanitize import sanitize
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import ADAPTER_KINDS, ActionKind

MOST_TEXT: Final = 300
"""Longest reason of a failure that is kept, characters."""
MOST_NAME: Final = 100
"""Longest name that is kept, characters."""
_MOST_WORDS = 16
_MOST_CORRECTIONS = 1000


@dataclass(frozen=True, slots=True)
class MotionCard:
    """What a motion adapter states of itself, over a socket and over ROS 2."""

    name: str
    version: str
    movements: frozenset[ActionKind]
    """Kinds of movements that it executes."""

    @classmethod
    def of(cls, content: object) -> Self:
        """Return the card of a message.

        Raises:
            ValueError: it is not a card.
        """
        if not isinstance(content, Mapping):
            raise ValueError("the card must be a map")  # noqa: TRY004 - a message, no argument
        name = text_in(content, "name", MOST_NAME)
        if not name:
            raise ValueError("the card has no `name`")
        movements = words_in(content, "movements", ADAPTER_KINDS, [ActionKind.MOVE])
        if ActionKind.MOVE not in movements:
            raise ValueError("the card's `movements` lack `move`, which every adapter executes")
        return cls(name, text_in(content, "version", MOST_NAME), frozenset(map(ActionKind, movements)))

    @property
    def condition(self) -> dict[str, str]:
        """Name and version, which results depend on."""
        return {"name": self.name, "version": self.version}

    def __str__(self) -> str:
        return f"{self.name} {self.version}".strip()


class MotionRefusal(StrEnum):
    """Why a movement was not executed to its end."""

    UNSUPPORTED = "unsupported"
    """The robot cannot execute this movement."""
    BLOCKED = "blocked"
    """The robot's own obstacle avoidance stopped it."""
    COLLISION = "collision"
    """The robot touched something."""
    STOPPED = "stopped"
    """The client said `stop`, or no longer answered."""
    DEADLINE = "deadline"
    """It was not done in time."""
    SENSOR = "sensor"
    """A sensor that the movement needs gave no valid data."""
    RIVAL = "rival"
    """Another program or a person drove the robot."""
    FAULT = "fault"
    """The base cannot move: an emergency stop, a fall, a low battery, a lost lease."""


def result_of_answer(answer: Mapping[str, Any], *, simulated: bool = False) -> MotionResult:
    """Return the result of an answer; the client measures the motion.

    Args:
        answer: `completed`, and optionally `refusal`, `failure`, `touched`, `corrections`, `duration_s`, `sensor_lost`.
            Without a refusal, a failed movement is a fault of the base.
        simulated: whether a simulator plays the robot, whose contacts have no bumper.

    Raises:
        ValueError: it does not say whether the movement is done, or a key has another type.
    """
    completed = answer.get("completed")
    if not isinstance(completed, bool):
        raise _invalid("completed", "true or false", completed)
    corrections = min(max(int(number_in(answer, "corrections", 0.0)), 0), _MOST_CORRECTIONS)
    duration_s = number_in(answer, "duration_s", 0.0)
    if completed:
        return MotionResult(completed=True, corrections=corrections, duration_s=duration_s)
    sensor_lost = answer.get("sensor_lost") is True
    given = answer.get("refusal") or (MotionRefusal.SENSOR if sensor_lost else MotionRefusal.FAULT)
    if given not in list(MotionRefusal):
        raise ValueError(f"`refusal` must be one of {', '.join(MotionRefusal)}, not {given!r:.40}")
    refusal = MotionRefusal(given)
    reason = text_in(answer, "failure", MOST_TEXT) or f"the adapter reports: {refusal}"
    collision = None
    if refusal is MotionRefusal.COLLISION:
        source = CollisionSource.CONTACT if simulated else CollisionSource.BUMPER
        collision = Collision(source, text_in(answer, "touched", MOST_TEXT))
    is_blocked = refusal is MotionRefusal.BLOCKED
    return MotionResult(
        completed=False,
        failure="" if is_blocked else reason,
        blocked=reason if is_blocked else "",
        collision=collision,
        corrections=corrections,
        duration_s=duration_s,
        sensor_lost=sensor_lost or refusal is MotionRefusal.SENSOR,
    )


def number_in(message: Mapping[str, Any], key: str, otherwise: float | None = None) -> float:
    """Return a finite number of a message; `otherwise` where it is absent.

    Raises:
        ValueError: it is not a finite number, or absent without an alternative.
    """
    value = message.get(key)
    if value is None and otherwise is not None:
        return otherwise
    try:
        if not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass  # an integer beyond every float, which JSON may have
    raise _invalid(key, "a finite number", value)


def text_in(message: Mapping[str, Any], key: str, longest: int) -> str:
    """Return a text of a message, sanitized and at most `longest` characters; empty where it is absent.

    Raises:
        ValueError: it is not a text.
    """
    value = message.get(key)
    if value is None:
        return ""
    if not isinstance(value, str):
        raise _invalid(key, "a text", value)
    return sanitize(value[:longest])


def words_in(
    message: Mapping[str, Any], key: str, known: Collection[str], otherwise: Sequence[str] = ()
) -> Sequence[str]:
    """Return a list of known words of a message; `otherwise` where it is absent.

    Raises:
        ValueError: it is not a list, or has another word.
    """
    values = message.get(key)
    if values is None:
        return otherwise
    if not isinstance(values, list | tuple) or len(values) > _MOST_WORDS:
        raise ValueError(f"`{key}` must be a list of words")
    if unknown := [value for value in values if not isinstance(value, str) or value not in known]:
        raise ValueError(f"`{key}` has {unknown[0]!r:.40}; the words are {', '.join(sorted(known))}")
    return values


def _invalid(key: str, wanted: str, value: object) -> ValueError:
    return ValueError(f"`{key}` must be {wanted}, not {value!r:.40}")
