"""Checks a policy's answer whole, and returns it as plain values of bounded size that nobody else holds.

Everything that is shown, recorded or sent later is what comes out here; so no later code has to fear it. What goes
into the record is bounded by `MOST_*`; numbers that are not finite are kept only where "not known" is an answer.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Final

import numpy as np

from vsnbench.errors import DecisionError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Box, Decision, Diagnostics, GridMap

MOST_NAME_CHARACTERS: Final = 200
MOST_NOTE_CHARACTERS: Final = 10_000
MOST_NUMBERS: Final = 1_000
"""Probabilities, and scalars."""
MOST_BOXES: Final = 1_000
MOST_POINTS: Final = 10_000
"""Of a path, and of nodes."""
MOST_MAP_CELLS: Final = 2048
"""Rows, and columns."""
MOST_DETAILS_BYTES: Final = 1 << 20
"""Of `details`, roughly as JSON."""
DEEPEST_DETAILS: Final = 32
SHOWN: Final = "shown"
"""The key in a recorded step's details under which lies what the viewer shows."""
SENSING: Final = "sensing"
"""The key under which lies how the look came about."""

_LARGEST_INTEGER = 2**63
_IN_DETAILS = ("a text in details", MOST_DETAILS_BYTES)
_OVERHEAD_BYTES = 4
"""Of each value beside its text."""


def checked_decision(answer: object) -> Decision:
    """Return a policy's answer, checked and copied; two calls share nothing.

    Raises:
        DecisionError: it is no decision, or a part of it cannot be shown and recorded; the message says which.
    """
    if not isinstance(answer, Decision):
        raise DecisionError(
            f"it is no Decision but {_kind(answer)}", advice="return Decision(Action.MOVE_FORWARD), for example"
        )
    if not isinstance(answer.action, Action):
        raise DecisionError(
            f"its action is no Action but {_kind(answer.action)}", advice="give Action.MOVE_FORWARD, for example"
        )
    if not isinstance(answer.diagnostics, Diagnostics):
        raise DecisionError(f"its diagnostics are no Diagnostics but {_kind(answer.diagnostics)}")
    raw_action = _text(answer.raw_action, "raw_action", MOST_NAME_CHARACTERS)
    return Decision(answer.action, raw_action, checked_diagnostics(answer.diagnostics))


def checked_diagnostics(given: Diagnostics) -> Diagnostics:
    """Return diagnostics, checked and copied.

    Raises:
        DecisionError: a part of them cannot be shown and recorded; the message says which.
    """
    return Diagnostics(
        probabilities={
            name: _probability(value, f"probabilities[{name!r}]")
            for name, value in _named(given.probabilities, "probabilities")
        },
        boxes=tuple(_box(each, f"boxes[{k}]") for k, each in enumerate(_items(given.boxes, "boxes", MOST_BOXES))),
        map=None if given.map is None else _map(given.map),
        sub_goal=None if given.sub_goal is None else _point(given.sub_goal, "sub_goal"),
        path=_points(given.path, "path"),
        nodes=_points(given.nodes, "nodes"),
        scalars={name: _number(value, f"scalars[{name!r}]") for name, value in _named(given.scalars, "scalars")},
        note=_text(given.note, "note", MOST_NOTE_CHARACTERS),
        details=_details(given.details),
    )


def _kind(value: object) -> str:
    name = type(value).__name__
    return f"{'an' if name[:1] in 'aeiouAEIOU' else 'a'} {name}"


def _text(value: object, what: str, most: int) -> str:
    if not isinstance(value, str):
        raise DecisionError(f"{what} is no text but {_kind(value)}")
    text = str.__str__(value)
    if len(text) > most:
        raise DecisionError(f"{what} has {len(text)} characters; at most {most} are kept")
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise DecisionError(f"{what} is no text: it holds half of a surrogate pair") from error
    if "\x00" in text:
        raise DecisionError(f"{what} is no text: it holds a NUL character")
    return text


def _named(value: object, what: str) -> list[tuple[str, object]]:
    """Return the pairs of a mapping from names."""
    if not isinstance(value, Mapping):
        raise DecisionError(f"{what} is no mapping from names to numbers but {_kind(value)}")
    pairs = list(islice(value.items(), MOST_NUMBERS + 1))
    if len(pairs) > MOST_NUMBERS:
        raise DecisionError(f"{what} has more than {MOST_NUMBERS} entries")
    return [(_text(name, f"a name in {what}", MOST_NAME_CHARACTERS), number) for name, number in pairs]


def _items(value: object, what: str, most: int) -> Sequence[Any]:
    if not isinstance(value, list | tuple | np.ndarray):
        raise DecisionError(f"{what} is no list but {_kind(value)}")
    items = list(islice(value, most + 1))
    if len(items) > most:
        raise DecisionError(f"{what} has more than {most} entries")
    return items


def _number(value: Any, what: str) -> float:
    """Return a number, which may be infinite or NaN."""
    try:
        if not isinstance(value, str | bytes | bytearray):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise DecisionError(f"{what} is no number that can be kept but {_kind(value)}")


def _finite(value: object, what: str) -> float:
    number = _number(value, what)
    if not math.isfinite(number):
        raise DecisionError(f"{what} is {number}")
    return number


def _probability(value: object, what: str) -> float:
    number = _finite(value, what)
    if not -1e-3 <= number <= 1 + 1e-3:
        raise DecisionError(f"{what} is {number:.6g}, which is no probability; put other numbers into scalars")
    return number


def _point(value: object, what: str) -> tuple[float, float]:
    pair = _items(value, what, 2)
    if len(pair) != 2:
        raise DecisionError(f"{what} is no point (x, y)")
    return (_finite(pair[0], what), _finite(pair[1], what))


def _points(value: object, what: str) -> tuple[tuple[float, float], ...]:
    points = _items(value, what, MOST_POINTS)
    return tuple(each if _is_point(each) else _point(each, f"{what}[{k}]") for k, each in enumerate(points))


def _is_point(value: Any) -> bool:
    """Whether it is what most policies give, and needs no copy."""
    if type(value) is not tuple or len(value) != 2:
        return False
    x_m, y_m = value
    return type(x_m) is float and type(y_m) is float and math.isfinite(x_m) and math.isfinite(y_m)


def _box(value: object, what: str) -> Box:
    if not isinstance(value, Box):
        raise DecisionError(f"{what} is no Box but {_kind(value)}")
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
        raise DecisionError(f"map is no GridMap but {_kind(value)}")
    cells = value.cells
    if not isinstance(cells, np.ndarray) or cells.ndim != 2 or cells.dtype != np.uint8:
        raise DecisionError("map.cells is no (rows, columns) array of uint8")
    if not 0 < min(cells.shape) <= max(cells.shape) <= MOST_MAP_CELLS:
        raise DecisionError(f"map.cells has shape {cells.shape}; from 1 to {MOST_MAP_CELLS} rows and columns are kept")
    kept = np.array(cells, np.uint8, order="C", copy=True)
    if kept.max() > 2:
        raise DecisionError("map.cells holds other numbers than 0 (unknown), 1 (free) and 2 (occupied)")
    kept.flags.writeable = False
    resolution_m = _finite(value.resolution_m, "map.resolution_m")
    if resolution_m <= 0:
        raise DecisionError(f"map.resolution_m is {resolution_m:.6g}")
    return GridMap(
        kept, _finite(value.origin_x_m, "map.origin_x_m"), _finite(value.origin_y_m, "map.origin_y_m"), resolution_m
    )


def _details(value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise DecisionError(f"details are no mapping but {_kind(value)}")
    kept: dict[str, Any] = _Plain().mapping(value, 0)
    if reserved := {SHOWN, SENSING} & kept.keys():
        raise DecisionError(f"details have the key {min(reserved)!r}, which vsnbench keeps for itself: choose another")
    return kept


class _Plain:
    """Copies nested values as what JSON has, within the bounds."""

    def __init__(self) -> None:
        self._room = MOST_DETAILS_BYTES

    def value(self, value: Any, depth: int) -> Any:
        kind = type(value)  # the usual ones first: this walks through everything that a policy keeps
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
                    raise DecisionError("details hold an integer of more than 64 bits")
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
        raise DecisionError(f"details hold {_kind(value)}, which is nothing that JSON has")

    def mapping(self, value: Mapping[Any, Any], depth: int) -> dict[str, Any]:
        self._descend(depth)
        kept: dict[str, Any] = {}
        for key, item in value.items():
            if isinstance(key, str):
                name = self._text(key)
            elif isinstance(key, int):
                name = str(self.value(key, depth))
            else:
                raise DecisionError(f"details have a key that is no text but {_kind(key)}")
            kept[name] = self.value(item, depth + 1)
        return kept

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
            raise DecisionError(f"details are nested more than {DEEPEST_DETAILS} deep, or contain themselves")

    def _spend(self, size_bytes: int) -> None:
        self._room -= size_bytes
        if self._room < 0:
            raise DecisionError(f"details take more than {MOST_DETAILS_BYTES >> 20} MiB")
