"""Results in the format of Habitat evaluations: episodes with their measures, and means over them."""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.atomic import atomic_file
from vsnbench.files.bounded_json import parse_json
from vsnbench.files.regular import open_regular
from vsnbench.interop.episodes import ExportedEpisode
from vsnbench.protocol.metrics import soft_spl, spl

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


def write_habitat(episodes: Sequence[ExportedEpisode], directory: Path) -> int:
    """Write `episode_results.json` and `aggregated_results.json` of the counted episodes; return their number.

    Means are by condition (model with weights and settings, robot, site, protocol, noise); the condition is included.

    Raises:
        RecordError: the files cannot be written.
    """
    counted = [episode for episode in episodes if episode.counts]
    names = _names(counted)
    results = [_fields(episode, names[_key(episode)]) for episode in counted]
    conditions = {names[_key(episode)]: dict(episode.condition) for episode in counted}
    means = {
        name: {**_means([result for result in results if result["condition"] == name]), "condition": condition}
        for name, condition in conditions.items()
    }
    for file, content in (("episode_results.json", results), ("aggregated_results.json", means)):
        with atomic_file(directory / file) as part:
            part.write_text(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    return len(results)


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


def _key(episode: ExportedEpisode) -> str:
    return json.dumps(episode.condition, sort_keys=True)


def _names(episodes: Sequence[ExportedEpisode]) -> dict[str, str]:
    """Return a name for each condition, numbered if model, environment and scene are not sufficient."""
    plain = {
        _key(episode): f"{episode.model}, {'simulated' if episode.simulated else 'real'}, {episode.site}"
        for episode in episodes
    }
    listed = list(plain.values())
    seen: Counter[str] = Counter()
    names = {}
    for key, name in plain.items():
        seen[name] += 1
        names[key] = f"{name} #{seen[name]}" if listed.count(name) > 1 else name
    return names


def _fields(episode: ExportedEpisode, condition: str) -> dict[str, Any]:
    shortest, left, path = episode.geodesic_start_m, episode.geodesic_end_m, episode.path_length_m
    success = bool(episode.success)
    return {
        "episode_id": str(episode.id),
        "scene_id": episode.site,
        "condition": condition,
        "model": episode.model,
        "environment": "simulated" if episode.simulated else "real",
        "object_category": episode.goal,
        "start_position": episode.start,
        "repetition": episode.repetition,
        "success": float(success),
        "spl": 0.0 if not success else None if shortest is None or path is None else spl(True, shortest, path),
        "soft_spl": None if shortest is None or path is None or left is None else soft_spl(shortest, left, path),
        "distance_to_goal": episode.distance_to_goal_m,
        "path_length": path,
        "geodesic_distance": shortest,
        "num_steps": episode.actions,
        "end_reason": episode.end_reason,
    }


def _means(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    means: dict[str, Any] = {"num_episodes": len(results)}
    for name in ("success", "spl", "soft_spl", "distance_to_goal", "path_length", "num_steps"):
        known = [result[name] for result in results if result[name] is not None]
        means[name] = sum(known) / len(known) if known else None
    return means


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
