"""Schedule and codes of a study, drawn from the plan and its seed.

All random choices use SHA-256, so that a plan gives the same schedule on every machine and Python version.
"""

import hashlib
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from typing import TypeVar

from vsnbench.errors import StudyError
from vsnbench.protocol.scheduled_trial import ScheduledTrial
from vsnbench.study.file import StudyFile

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Schedule:
    """A drawn schedule with the arms' codes."""

    trials: tuple[ScheduledTrial, ...]
    codes: dict[str, str]
    """Arm -> letter shown in a blinded study."""

    @property
    def fingerprint(self) -> str:
        """Hash of the schedule and codes."""
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

    A study that is evaluated after every starting position runs them one after another in random order. Within each,
    and in every other study with `order: blocks`, the blocks are in random order.

    Args:
        study: the plan.
        starts: numbers of its starting positions.
        excluded: excluded combinations of goal and starting position (`Site.excluded`).

    Raises:
        StudyError: all combinations of the shared goals are excluded.
    """
    return _draw(study, starts, excluded, start_by_start=study.by_starting_position)


def schedules_of(
    study: StudyFile, starts: Sequence[int], excluded: Container[tuple[str, int]] = ()
) -> tuple[Schedule, ...]:
    """Return all schedules that a lock of this study can have; the currently drawn one is first.

    Earlier versions drew all studies with `order: blocks` in random order of all blocks, and an amendment may change
    the stopping rule but not the schedule. Arguments and errors are those of `draw_schedule`.
    """
    if study.order != "blocks":
        return (draw_schedule(study, starts, excluded),)
    now = study.by_starting_position
    return tuple(_draw(study, starts, excluded, start_by_start=by_start) for by_start in (now, not now))


def _draw(
    study: StudyFile, starts: Sequence[int], excluded: Container[tuple[str, int]], *, start_by_start: bool
) -> Schedule:
    goals = list(dict.fromkeys(goal for arm in study.arms for goal in study.goals_of(arm)))
    cells = [
        _Cell(goal, start, repetition, tuple(arm for arm in study.arms if goal in study.goals_of(arm)))
        for repetition in range(1, study.repetitions + 1)
        for goal in goals
        for start in starts
        if (goal, start) not in excluded
    ]
    if not any(cell.goal in study.goals for cell in cells):
        raise StudyError(
            "the site excludes every shared goal from every starting position of the study "
            "(not_for of the start, or starts of the goal)"
        )
    if study.real_cells is not None:
        cells = _real_cells(study, cells)
    if study.order == "blocks":
        cells = _shuffled(cells, f"{study.seed}/blocks")
    if start_by_start:
        place = {start: rank for rank, start in enumerate(_shuffled(starts, f"{study.seed}/starts"))}
        cells = sorted(cells, key=lambda cell: place[cell.start])  # keeps the random order within each
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


def _real_cells(study: StudyFile, cells: Sequence[_Cell]) -> list[_Cell]:
    """Return the cells of the shared goals that are drawn for real trials, and the cells of other goals.

    Raises:
        StudyError: the site has too few cells for the draw.
    """
    places = sorted({(cell.goal, cell.start) for cell in cells if cell.goal in study.goals})
    count = study.real_cells or 0
    if count >= len(places):
        raise StudyError(
            f"real_cells: {count} of {len(places)} cells leaves none to the twin",
            advice=f"give less than {len(places)}, or leave real_cells out",
            code="no-twin-cells",
        )
    drawn = set(_shuffled(places, f"{study.seed}/real-cells")[:count])
    return [cell for cell in cells if cell.goal not in study.goals or (cell.goal, cell.start) in drawn]


def _shuffled(items: Iterable[Item], key: str) -> list[Item]:
    """Return the items in a pseudo-random order determined by the key."""
    drawn = [(hashlib.sha256(f"{key}/{place}".encode()).digest(), item) for place, item in enumerate(items)]
    return [item for _, item in sorted(drawn, key=lambda pair: pair[0])]
