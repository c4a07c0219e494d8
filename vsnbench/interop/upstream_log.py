"""Reads log folders of upstream ROS4VSN: `datos.csv` with one line per episode, and images `rgb/N.png`."""

import csv
import io
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.regular import open_regular
from vsnbench.values.movement import Action

_WORDS: dict[str, tuple[Action, str]] = {
    "stop": (Action.STOP, "STOP"),
    "forward": (Action.MOVE_FORWARD, "MOVE_FORWARD"),
    "left": (Action.TURN_LEFT, "TURN_LEFT"),
    "right": (Action.TURN_RIGHT, "TURN_RIGHT"),
    "backward": (Action.MOVE_BACKWARD, "MOVE_BACKWARD"),
    # Upstream's adaptation of PIRLNav's camera actions (paper, Section 3.2.2).
    "up": (Action.MOVE_BACKWARD, "LOOK_UP"),
    "down": (Action.MOVE_FORWARD, "LOOK_DOWN"),
}
_NUMBERS = ("stop", "forward", "left", "right", "up", "down")
"""Action numbers of Habitat, which upstream logs for some models."""


@dataclass(frozen=True, slots=True)
class LoggedAction:
    """An action, with the model's own name for it."""

    action: Action
    raw_action: str


@dataclass(frozen=True, slots=True)
class LoggedEpisode:
    """One line of the log."""

    started_at: datetime | None
    goal: str
    actions: tuple[LoggedAction, ...]
    pictures: tuple[Path, ...]
    """One image per action; empty if they cannot be assigned."""

    @property
    def stopped(self) -> bool:
        """Whether the last action was STOP."""
        return bool(self.actions) and self.actions[-1].action is Action.STOP


def read_upstream_log(directory: Path) -> tuple[LoggedEpisode, ...]:
    """Read a log folder.

    Raises:
        UsageError: the format is invalid; the message names the line.
        RecordError: the folder cannot be read.
    """
    file = directory / "datos.csv"
    if not file.is_file():
        raise UsageError(f"{directory} has no datos.csv", advice="name the folder with the log of upstream's client")
    try:
        with io.TextIOWrapper(open_regular(file), encoding="utf-8-sig") as opened:
            lines = list(csv.reader(opened.read().splitlines(), skipinitialspace=True))
    except (OSError, UnicodeDecodeError) as error:
        raise RecordError(f"cannot read {file}: {error}") from error
    except csv.Error as error:
        raise UsageError(f"{file}: {error}", code="invalid-log") from error
    rows = []
    for number, row in enumerate(lines, start=1):
        if not row or not any(field.strip() for field in row):
            continue
        if len(row) < 4:
            raise UsageError(f"{file}:{number}: expected time, goal, list of actions and their count")
        if number == 1 and not re.search(r"\d", row[-1]):
            continue  # a heading
        rows.append((number, row))
    if not rows:
        raise UsageError(f"{file} contains no episode")
    parsed = [_episode(f"{file}:{number}", row) for number, row in rows]
    pictures = _pictures(directory / "rgb")
    if len(pictures) != sum(len(actions) for _, _, actions in parsed):
        pictures = []
    episodes = []
    for time, goal, actions in parsed:
        mine, pictures = pictures[: len(actions)], pictures[len(actions) :]
        episodes.append(LoggedEpisode(_time(time), goal, actions, tuple(mine)))
    return tuple(episodes)


def _episode(where: str, row: list[str]) -> tuple[str, str, tuple[LoggedAction, ...]]:
    # The list of actions contains commas, quoted or not.
    time, goal, *middle, count = [field.strip() for field in row]
    words = re.findall(r"[A-Za-z_]+|\d+", ",".join(middle))
    actions = tuple(_action(where, word) for word in words)
    if not goal:
        raise UsageError(f"{where}: the goal is empty")
    if not actions:
        raise UsageError(f"{where}: the list of actions is empty")
    if not _is_number(count) or int(count) != len(actions):
        raise UsageError(f"{where}: {len(actions)} actions are listed, but the count is {count[:20]!r}")
    return time, goal, actions


def _action(where: str, word: str) -> LoggedAction:
    if word.isdecimal():
        if not _is_number(word) or int(word) >= len(_NUMBERS):
            raise UsageError(f"{where}: action number {word[:20]} is unknown")
        key = _NUMBERS[int(word)]
    else:
        key = word.lower().removeprefix("move_").removeprefix("turn_").removeprefix("look_")
    if key not in _WORDS:
        raise UsageError(f"{where}: unknown action {word[:20]!r}; known are {', '.join(_WORDS)} and 0 to 5")
    action, raw = _WORDS[key]
    return LoggedAction(action, raw)


def _is_number(text: str) -> bool:
    """Return whether a text is an integer of a length that `int` reads; `isdigit` accepts superscripts as well."""
    return text.isdecimal() and len(text) < 19


def _pictures(directory: Path) -> list[Path]:
    if not directory.is_dir():
        return []
    numbered = [(int(path.stem), path) for path in directory.glob("*.png") if _is_number(path.stem)]
    return [path for _, path in sorted(numbered)]


def _time(text: str) -> datetime | None:
    try:
        return datetime.fromtimestamp(float(text), UTC)
    except (ValueError, OverflowError, OSError):
        pass
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
