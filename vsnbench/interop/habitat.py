"""Reads results of Habitat evaluations: a list of judged episodes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.bounded_json import parse_json
from vsnbench.files.regular import open_regular

_GOAL = ("object_category", "goal", "target", "category")
_STEPS = ("num_steps", "steps", "actions")
_SUCCESS = ("success",)
_DISTANCE = ("distance_to_goal",)
_PATH = ("path_length",)
_SHORTEST = ("geodesic_distance", "start_geodesic_distance")


@dataclass(frozen=True, slots=True)
class HabitatEpisode:
    """One episode of a simulator's results."""

    goal: str
    success: bool
    steps: int
    distance_to_goal_m: float | None = None
    path_length_m: float | None = None
    geodesic_distance_m: float | None = None


def read_habitat(path: Path) -> tuple[HabitatEpisode, ...]:
    """Read the episodes of a results file: a list of objects, that list as `episodes`, or an object of objects.

    Raises:
        UsageError: the format is invalid; the message names the episode and the field.
        RecordError: the file cannot be read.
    """
    try:
        with open_regular(path) as file:
            content = parse_json(file.read())
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path} is not JSON: {error}") from error
    if isinstance(content, dict) and isinstance(content.get("episodes"), list):
        content = content["episodes"]
    rows = list(content.values()) if isinstance(content, dict) else content
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise UsageError(
            f"{path} has no list of episodes with goal, success and steps; means over episodes cannot be imported"
        )
    return tuple(_read(row, f"{path}: episode {number}") for number, row in enumerate(rows, start=1))


def _read(row: dict[str, Any], where: str) -> HabitatEpisode:
    goal = _first(row, _GOAL, where)
    if not isinstance(goal, str) or not goal:
        raise UsageError(f"{where}: {' or '.join(_GOAL)} must name the goal, not {goal!r}")
    success = _number(_first(row, _SUCCESS, where), "success", where)
    steps = _number(_first(row, _STEPS, where), "steps", where)
    if success not in (0.0, 1.0):
        raise UsageError(f"{where}: success must be 0 or 1, not {success:g}")
    if steps < 0 or steps != int(steps):
        raise UsageError(f"{where}: the number of steps must be an integer, not {steps:g}")
    lengths = [
        _number(_first(row, names), names[0], where) if _first(row, names) is not None else None
        for names in (_DISTANCE, _PATH, _SHORTEST)
    ]
    return HabitatEpisode(goal, bool(success), int(steps), *lengths)


def _first(row: dict[str, Any], names: Sequence[str], where: str = "") -> Any:
    found = next((row[name] for name in names if row.get(name) is not None), None)
    if found is None and where:
        raise UsageError(f"{where}: {' or '.join(names)} is missing")
    return found


def _number(value: Any, name: str, where: str) -> float:
    if isinstance(value, bool | int | float) and math.isfinite(value) and value >= 0:
        return float(value)
    raise UsageError(f"{where}: {name} must be a non-negative number, not {value!r}")
