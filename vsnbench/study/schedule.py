"""The schedule of a study and its codes: who is tried where, and when, drawn from the plan and its seed alone.

Whatever is drawn follows from SHA-256, so that the same plan gives the same schedule on every machine and Python.
"""

import hashlib
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from typing import TypeVar

from vsnbench.errors import StudyError
from vsnbench.study.file import StudyFile

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class ScheduledTrial:
    """One trial of a study, in its place."""

    rank: int
    """From 0."""
    block: int
    """From 0: every arm once on one cell; what is not in blocks has the number of its cell all the same."""
    arm: str
    goal: str
    start: int
    repetition: int

    @property
    def words(self) -> str:
        """Where it is, for people."""
        return f"{self.goal} from {self.start}" + (f", repetition {self.repetition}" if self.repetition > 1 else "")


@dataclass(frozen=True, slots=True)
class Schedule:
    """Everything that was drawn."""

    trials: tuple[ScheduledTrial, ...]
    codes: dict[str, str]
    """Arm -> its letter while people are blind."""

    @property
    def fingerprint(self) -> str:
        """Hash of the whole schedule."""
        rows = [f"{t.rank}/{t.block}/{t.arm}/{t.goal}/{t.start}/{t.repetition}" for t in self.trials]
        return hashlib.sha256("\n".join([*rows, *(f"{a}={c}" for a, c in self.codes.items())]).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class _Cell:
    goal: str
    start: int
    repetition: int
    arms: tuple[str, ...]


def draw_schedule(study: StudyFile, starts: Sequence[int], excluded: Container[tuple[str, int]] = ()) -> Schedule:
    """Draw the order of the trials and the arms' codes.

    Args:
        study: the plan.
        starts: the numbers of its starting positions.
        excluded: goals with a starting position that is not for them (`Site.excluded`).

    Raises:
        StudyError: nothing of the shared goals is left.
    """
    goals = list(dict.fromkeys(goal for arm in study.arms for goal in study.goals_of(arm)))
    cells = [
        _Cell(goal, start, repetition, tuple(arm for arm in study.arms if goal in study.goals_of(arm)))
        for repetition in range(1, study.repetitions + 1)
        for goal in goals
        for start in starts
        if (goal, start) not in excluded
    ]
    if not any(cell.goal in study.goals for cell in cells):
        raise StudyError("the site excludes every shared goal from every starting position of the study (not_for)")
    if study.order == "blocks":
        cells = _shuffled(cells, f"{study.seed}/blocks")
    number = {cell: block for block, cell in enumerate(cells)}
    pairs = [(cell, arm) for cell in cells for arm in _shuffled(cell.arms, f"{study.seed}/{number[cell]}/arms")]
    if study.order == "shuffled":
        pairs = _shuffled(pairs, f"{study.seed}/trials")
    elif study.order == "as-planned":
        pairs = [(cell, arm) for arm in study.arms for cell in cells if arm in cell.arms]
    trials = tuple(
        ScheduledTrial(rank, number[cell], arm, cell.goal, cell.start, cell.repetition)
        for rank, (cell, arm) in enumerate(pairs)
    )
    letters = zip(_shuffled(sorted(study.arms), f"{study.seed}/codes"), ascii_uppercase, strict=False)
    return Schedule(trials, dict(letters))


def _shuffled(items: Iterable[Item], key: str) -> list[Item]:
    """Return the items in an order that follows from the key: each draws a number, and they line up by it."""
    drawn = [(hashlib.sha256(f"{key}/{place}".encode()).digest(), item) for place, item in enumerate(items)]
    return [item for _, item in sorted(drawn, key=lambda one: one[0])]
