"""Detection of sites that were surveyed in a unit other than metres."""

from collections.abc import Iterator
from typing import Any

LARGEST_M = 200.0
"""Maximum absolute value of a site's coordinates."""

_UNITS = (("centimetres", 100), ("millimetres", 1000))


def check_rooms(content: Any) -> Any:
    """Return the raw content of a site file if its rooms may be in metres.

    Raises:
        ValueError: a room is too large; the message has the likely unit.
    """
    rooms = content.get("rooms") if isinstance(content, dict) else None
    for room in rooms if isinstance(rooms, list) else ():
        corners = room.get("polygon") if isinstance(room, dict) else None
        farthest = max((abs(number) for number in _numbers(corners, 2)), default=0.0)
        if farthest > LARGEST_M:
            unit, times = _meant(farthest)
            raise ValueError(
                f"room {str(room.get('name'))[:40]} reaches to {farthest:g}: this looks like {unit}; in metres it is "
                f"{farthest / times:g}"
            )
    return content


def check_coordinate(coordinate_m: float) -> float:
    """Return a coordinate if it may be in metres.

    Raises:
        ValueError: the coordinate is too large; the message has the likely unit.
    """
    if abs(coordinate_m) > LARGEST_M:
        unit, times = _meant(abs(coordinate_m))
        raise ValueError(
            f"{coordinate_m:g} m is more than {LARGEST_M:g} m from the origin: this looks like {unit}; in metres it is "
            f"{coordinate_m / times:g}"
        )
    return coordinate_m


def _meant(farthest: float) -> tuple[str, int]:
    return next((unit for unit in _UNITS if farthest / unit[1] <= LARGEST_M / 4), _UNITS[-1])


def _numbers(value: Any, deep: int) -> Iterator[float]:
    if isinstance(value, list) and deep:
        for item in value:
            yield from _numbers(item, deep - 1)
    elif isinstance(value, int | float):
        yield value
