"""Validation of a policy's decision; returns a copy with plain values of bounded size.

All later code shows, records and sends this copy. `MOST_*` limit its size. Non-finite numbers are accepted only in
fields where they mean "unknown".
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import Any, Final, get_args

import numpy as np

from vsnbench.errors import DecisionError
from vsnbench.text.sanitize import without_controls
from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.values.movement import MAX_PARTS, Action, Movement, action_of

MOST_NAME_CHARACTERS: Final = 200
MOST_NOTE_CHARACTERS: Final = 10_000
MOST_NUMBERS: Final = 1_000
"""Maximum number of probabilities, and of scalars."""
MOST_BOXES: Final = 1_000
MOST_POINTS: Final = 10_000
"""Maximum number of points of a path, and of nodes."""
MOST_MAP_CELLS: Final = 2048
"""Maximum number of rows, and of columns."""
MOST_DETAILS_BYTES: Final = 1 << 20
"""Maximum size of `details`, approximately as JSON."""
DEEPEST_DETAILS: Final = 32
SHOWN: Final = "shown"
"""Key in a recorded step's details for what the viewer shows."""
SENSING: Final = "sensing"
"""Key for how the observation was made."""

_LARGEST_INTEGER = 2**63
_IN_DETAILS = ("a text in details", MOST_DETAILS_BYTES)
_OVERHEAD_BYTES = 4
"""Assumed size of a value in addition to its text."""


def checked_decision(answer: object) -> Decision:
    """Return a validated copy of a policy's decision.

    Raises:
        DecisionError: it is not a decision, or a part of it cannot be shown and recorded.
    """
    if not isinstance(answer, Decision):
        raise DecisionError(
            f"expected a Decision, got {_kind(answer)}", advice="return Decision(Action.MOVE_FORWARD), for example"
        )
    if not isinstance(answer.action, Action):
        raise DecisionError(
            f"action must be an Action or a movement, got {_kind(answer.action)}",
            advice="use Action.MOVE_FORWARD or Waypoint(1.0, 0.0), for example",
        )
    parts = _checked_parts(answer.parts)
    movement = None if answer.movement is None else checked_movement(answer.movement)
    if movement is not None and action_of(movement) is not answer.action:
        raise DecisionError(f"{answer.action} does not fit its movement, {_kind(movement)}")
    if answer.action.has_parameters != (movement is not None):
        raise DecisionError(f"{answer.action} needs a movement: return Decision(Waypoint(1.0, 0.0)), for example")
    if not isinstance(answer.diagnostics, Diagnostics):
        raise DecisionError(f"diagnostics must be Diagnostics, got {_kind(answer.diagnostics)}")
    raw_action = _text(answer.raw_action, "raw_action", MOST_NAME_CHARACTERS)
    return Decision(answer.action, raw_action, checked_diagnostics(answer.diagnostics), movement, parts)


def _checked_parts(parts: object) -> tuple[Action | Movement, ...]:
    """Return the validated parts of a chunk.

    Raises:
        DecisionError: there are too many, or one of them is neither an action nor a movement.
    """
    if not isinstance(parts, tuple | list):
        raise DecisionError(f"the parts of a chunk must be a list, got {type(parts).__name__}")
    if len(parts) > MAX_PARTS:
        raise DecisionError(f"a chunk must have at most {MAX_PARTS} parts, got {len(parts)}")
    return tuple(_checked_part(part) for part in parts)


def _checked_part(part: object) -> Action | Movement:
    if isinstance(part, Action):
        if part.has_parameters:
            raise DecisionError(f"{part} needs its parameters: put the movement itself into the chunk")
        return part
    return checked_movement(part)


def checked_movement(given: object) -> Movement:
    """Return a validated copy of a movement, which does not hold headings: only the robot's own actions do.

    Raises:
        DecisionError: it is not a movement, or a number is not finite or beyond its limit.
    """
    for made in get_args(Movement):
        if isinstance(given, made):
            checked: Movement = made.checked(given)
            return checked
    example = "use Waypoint(1.0, 0.0), for example"
    raise DecisionError(f"expected a movement, got {type(given).__name__}", advice=example)


def checked_diagnostics(given: Diagnostics) -> Diagnostics:
    """Return a validated copy of diagnostics.

    Raises:
        DecisionError: a part of them cannot be shown and recorded.
    """
    return Diagnostics(**{name: check(getattr(given, name)) for name, check in _CHECKS.items()})


def _kind(value: object) -> str:
    name = type(value).__name__
    return f"{'an' if name[:1] in 'aeiouAEIOU' else 'a'} {name}"


def _text(value: object, what: str, most: int) -> str:
    if not isinstance(value, str):
        raise DecisionError(f"{what} must be text, got {_kind(value)}")
    text = str.__str__(value)
    if len(text) > most:
        raise DecisionError(f"{what} must have at most {most} characters, got {len(text)}")
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise DecisionError(f"{what} must be valid Unicode; it contains half of a surrogate pair") from error
    if "\x00" in text:
        raise DecisionError(f"{what} must not contain a NUL character")
    return without_controls(text)


def _named(value: object, what: str) -> list[tuple[str, object]]:
    """Return the items of a mapping with names as keys."""
    if not isinstance(value, Mapping):
        raise DecisionError(f"{what} must be a mapping from names to numbers, got {_kind(value)}")
    pairs = list(islice(value.items(), MOST_NUMBERS + 1))
    if len(pairs) > MOST_NUMBERS:
        raise DecisionError(f"{what} must have at most {MOST_NUMBERS} entries")
    return [(_text(name, f"a name in {what}", MOST_NAME_CHARACTERS), number) for name, number in pairs]


def _items(value: object, what: str, most: int) -> Sequence[Any]:
    if not isinstance(value, list | tuple | np.ndarray):
        raise DecisionError(f"{what} must be a list, got {_kind(value)}")
    items = list(islice(value, most + 1))
    if len(items) > most:
        raise DecisionError(f"{what} must have at most {most} entries")
    return items


def _number(value: Any, what: str) -> float:
    """Return a number, which may be infinite or NaN."""
    try:
        if not isinstance(value, str | bytes | bytearray):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise DecisionError(f"{what} must be a number, got {_kind(value)}")


def _finite(value: object, what: str) -> float:
    number = _number(value, what)
    if not math.isfinite(number):
        raise DecisionError(f"{what} must be a finite number, got {number}")
    return number


def _probability(value: object, what: str) -> float:
    number = _finite(value, what)
    if not -1e-3 <= number <= 1 + 1e-3:
        raise DecisionError(f"{what} must be from 0 to 1, got {number:.6g}", advice="put other numbers into scalars")
    return number


def _point(value: object, what: str) -> tuple[float, float]:
    pair = _items(value, what, 2)
    if len(pair) != 2:
        raise DecisionError(f"{what} must be a point (x, y)")
    return (_finite(pair[0], what), _finite(pair[1], what))


def _points(value: object, what: str) -> tuple[tuple[float, float], ...]:
    points = _items(value, what, MOST_POINTS)
    return tuple(point if _is_point(point) else _point(point, f"{what}[{k}]") for k, point in enumerate(points))


def _is_point(value: Any) -> bool:
    """Whether a point needs no conversion; most policies give such points."""
    if type(value) is not tuple or len(value) != 2:
        return False
    x_m, y_m = value
    return type(x_m) is float and type(y_m) is float and math.isfinite(x_m) and math.isfinite(y_m)


def _box(value: object, what: str) -> Box:
    if not isinstance(value, Box):
        raise DecisionError(f"{what} must be a Box, got {_kind(value)}")
    return Box(
        left=_finite(value.left, f"{what}.left"),
        top=_finite(value.top, f"{what}.top"),
        right=_finite(value.right, f"{what}.right"),
        bottom=_finite(value.bottom, f"{what}.bottom"),
        label=_text(value.label, f"{what}.label", MOST_NAME_CHARACTERS),
        score=_finite(value.score, f"{what}.score"),
    )


def _map(value: object) -> GridMap:
    if not isinstance(value, GridMap):
        raise DecisionError(f"map must be a GridMap, got {_kind(value)}")
    cells = value.cells
    if not isinstance(cells, np.ndarray) or cells.ndim != 2 or cells.dtype != np.uint8:
        raise DecisionError("map.cells must be a (rows, columns) array of uint8")
    if not 0 < min(cells.shape) <= max(cells.shape) <= MOST_MAP_CELLS:
        raise DecisionError(f"map.cells must have 1 to {MOST_MAP_CELLS} rows and columns, got shape {cells.shape}")
    copy = np.array(cells, np.uint8, order="C", copy=True)
    if copy.max() > 2:
        raise DecisionError("map.cells must be 0 (unknown), 1 (free) or 2 (occupied)")
    copy.flags.writeable = False
    resolution_m = _finite(value.resolution_m, "map.resolution_m")
    if resolution_m <= 0:
        raise DecisionError(f"map.resolution_m must be above 0, got {resolution_m:.6g}")
    return GridMap(
        copy, _finite(value.origin_x_m, "map.origin_x_m"), _finite(value.origin_y_m, "map.origin_y_m"), resolution_m
    )


def _details(value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise DecisionError(f"details must be a mapping, got {_kind(value)}")
    details: dict[str, Any] = _Plain().mapping(value, 0)
    if reserved := {SHOWN, SENSING} & details.keys():
        raise DecisionError(f"details must not have the reserved key {min(reserved)!r}", advice="choose another key")
    return details


_CHECKS: Final[Mapping[str, Callable[[Any], Any]]] = {
    "probabilities": lambda given: {
        name: _probability(value, f"probabilities[{name!r}]") for name, value in _named(given, "probabilities")
    },
    "boxes": lambda given: tuple(_box(box, f"boxes[{k}]") for k, box in enumerate(_items(given, "boxes", MOST_BOXES))),
    "map": lambda given: None if given is None else _map(given),
    "sub_goal": lambda given: None if given is None else _point(given, "sub_goal"),
    "path": lambda given: _points(given, "path"),
    "nodes": lambda given: _points(given, "nodes"),
    "scalars": lambda given: {name: _number(value, f"scalars[{name!r}]") for name, value in _named(given, "scalars")},
    "note": lambda given: _text(given, "note", MOST_NOTE_CHARACTERS),
    "details": _details,
}
"""Field of `Diagnostics` -> function that returns a validated copy of it."""


class _Plain:
    """Copies nested values to JSON types within the limits."""

    def __init__(self) -> None:
        self._room = MOST_DETAILS_BYTES

    def value(self, value: Any, depth: int) -> Any:
        kind = type(value)  # common types first for speed: this visits every value
        if kind is float:
            self._spend(2 * _OVERHEAD_BYTES)
            return value if math.isfinite(value) else None
        if kind is dict:
            return self.mapping(value, depth)
        if kind is list:
            return self._sequence(value, depth)
        match value:
            case None | bool():
                self._spend(_OVERHEAD_BYTES)
                return value
            case int():
                self._spend(_OVERHEAD_BYTES)
                if not -_LARGEST_INTEGER <= value < _LARGEST_INTEGER:
                    raise DecisionError("details must not have integers of more than 64 bits")
                return int.__int__(value)
            case float():
                self._spend(2 * _OVERHEAD_BYTES)
                return float.__float__(value) if math.isfinite(value) else None
            case str():
                return self._text(value)
            case Mapping():
                return self.mapping(value, depth)
            case list() | tuple():
                return self._sequence(value, depth)
            case np.ndarray() | np.bool_() | np.integer() | np.floating():
                self._spend(2 * value.nbytes)
                return self.value(value.tolist() if not isinstance(value, np.floating) else float(value), depth)
        raise DecisionError(f"details must have JSON types only, got {_kind(value)}")

    def mapping(self, value: Mapping[Any, Any], depth: int) -> dict[str, Any]:
        self._descend(depth)
        copy: dict[str, Any] = {}
        for key, item in value.items():
            if isinstance(key, str):
                name = self._text(key)
            elif isinstance(key, int):
                name = str(self.value(key, depth))
            else:
                raise DecisionError(f"keys of details must be text, got {_kind(key)}")
            copy[name] = self.value(item, depth + 1)
        return copy

    def _text(self, value: str) -> str:
        text = value if type(value) is str else str.__str__(value)
        self._spend(_OVERHEAD_BYTES + len(text))
        return text if text.isascii() and "\x00" not in text else _text(text, *_IN_DETAILS)

    def _sequence(self, value: Sequence[Any], depth: int) -> list[Any]:
        self._descend(depth)
        return [self.value(item, depth + 1) for item in value]

    def _descend(self, depth: int) -> None:
        self._spend(_OVERHEAD_BYTES)
        if depth > DEEPEST_DETAILS:
            raise DecisionError(f"details must be nested at most {DEEPEST_DETAILS} deep and not contain themselves")

    def _spend(self, size_bytes: int) -> None:
        self._room -= size_bytes
        if self._room < 0:
            raise DecisionError(f"details must take at most {MOST_DETAILS_BYTES >> 20} MiB")
