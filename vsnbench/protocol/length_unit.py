"""Notices a site that was surveyed in another unit than metres, before each of its coordinates is complained of."""

from collections.abc import Iterator
from typing import Any

LARGEST_M = 200.0
"""No coordinate of a site lies farther from the origin: a survey in centimetres is noticed before it is built."""

_UNITS = (("centimetres", 100), ("millimetres", 1000))


def in_metres(content: Any) -> Any:
    """Return the content of a site file, as YAML gave it, where it may be metres; anything but a site unseen.

    Raises:
        ValueError: a room reaches farther than any; the message says which, and what unit that looks like.
    """
    rooms = content.get("rooms") if isinstance(content, dict) else None
    for room in rooms if isinstance(rooms, list) else ():
        corners = room.get("polygon") if isinstance(room, dict) else None
        farthest = max((abs(number) for number in _numbers(corners, 2)), default=0.0)
        if farthest > LARGEST_M:
            unit, times = _meant(farthest)
            raise ValueError(
                f"room {str(room.get('name'))[:40]} reaches to {farthest:g}: these look like {unit}; lengths are "
                f"metres, so that is {farthest / times:g}"
            )
    return content


def near_enough(coordinate_m: float) -> float:
    """Return a coordinate of a site that may be one.

    Raises:
        ValueError: it lies farther from the origin than any; the message says what unit that looks like.
    """
    if abs(coordinate_m) > LARGEST_M:
        unit, times = _meant(abs(coordinate_m))
        raise ValueError(
            f"{coordinate_m:g} m is more than {LARGEST_M:g} m from the origin: these look like {unit}; in metres it is "
            f"{coordinate_m / times:g}"
        )
    return coordinate_m


def _meant(farthest: float) -> tuple[str, int]:
    return next((each for each in _UNITS if farthest / each[1] <= LARGEST_M / 4), _UNITS[-1])


def _numbers(value: Any, deep: int) -> Iterator[float]:
    if isinstance(value, list) and deep:
        for each in value:
            yield from _numbers(each, deep - 1)
    elif isinstance(value, int | float):
        yield value
