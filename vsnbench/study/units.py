"""Independent units of a sequential study, and their values in the betting tests.

For inference about these cells, the plan is the whole population and the order of the blocks is random: a unit is a
block (every arm once on one cell and repetition), drawn without replacement. Repetitions need not be independent.

For inference about cells like these, only starting positions are independent draws from a population. All shared goals
and repetitions of a starting position are one unit whose value is their mean. A unit counts when all its blocks are
complete. Units are ordered by when the schedule completes them, so that outcomes do not influence the order.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.sequential.betting import (
    FRACTIONS,
    MEAN_FRACTIONS,
    PROGRESS_FRACTIONS,
    PROGRESS_MEAN_FRACTIONS,
    as_share,
)
from vsnbench.study.file import StudyFile

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Block:
    """A block of the schedule with its available results."""

    goal: str
    start: int
    succeeded: Mapping[str, bool]
    """Arm -> success, for the arms with a result."""
    progress: Mapping[str, float] = field(default_factory=dict)
    """Arm -> progress from 0 to 1, for the arms with a result whose progress is known."""

    def values(self, study: StudyFile) -> Mapping[str, float]:
        """Return the values of the study's primary metric by arm."""
        return self.progress if study.of_progress else self.succeeded


class Place(Protocol):
    """A cell: a goal from a starting position."""

    @property
    def goal(self) -> str:
        """Category of the goal."""

    @property
    def start(self) -> int:
        """Number of the starting position."""


class ScheduledResult(Protocol):
    """A scheduled trial and its result, as the database returns it."""

    @property
    def block(self) -> int:
        """Number of its block in the schedule."""

    @property
    def arm(self) -> str:
        """Name of its arm."""

    @property
    def success(self) -> bool | None:
        """None without a result."""

    @property
    def progress(self) -> float | None:
        """None without a result, or if it is unknown."""

    @property
    def trial(self) -> Place:
        """Its cell."""


def shared_blocks(results: Iterable[ScheduledResult], goals: Sequence[str]) -> list[Block]:
    """Return all blocks of the shared goals with their results, in the order of the schedule.

    Args:
        results: all scheduled trials of the study.
        goals: the shared goals.
    """
    places: dict[int, Place] = {}
    succeeded: dict[int, dict[str, bool]] = {}
    progress: dict[int, dict[str, float]] = {}
    for result in results:
        if result.trial.goal in goals:
            places[result.block] = result.trial
            known = succeeded.setdefault(result.block, {})
            if result.success is not None:
                known[result.arm] = result.success
                if result.progress is not None:
                    progress.setdefault(result.block, {})[result.arm] = result.progress
    return [
        Block(places[block].goal, places[block].start, succeeded[block], progress.get(block, {}))
        for block in sorted(places)
    ]


@dataclass(frozen=True, slots=True)
class UnitRule:
    """Kind of unit of a study, and the parameters of its bets."""

    name: str
    """Singular."""
    planned: int
    size: int | None
    """Number of units of the population: the planned ones, or None for an infinite one."""
    fractions: Floats
    """Fractions of the capital staked in each bet."""


@dataclass(frozen=True, slots=True)
class UnitSeries:
    """Complete units of one question, in order."""

    values: tuple[float, ...]
    """Mean of each unit, mapped to 0 to 1: a difference of -1 is 0."""
    blocks: tuple[Block, ...]
    """All blocks of these units."""


BLOCK, START = "block", "starting position"


def unit_rule(study: StudyFile, blocks: Sequence[Block]) -> UnitRule:
    """Return the kind of unit of a study."""
    fractions = bet_fractions(by_start=not study.of_these_cells, of_progress=study.of_progress)
    if study.of_these_cells:
        return UnitRule(BLOCK, len(blocks), len(blocks), fractions)
    return UnitRule(START, len({block.start for block in blocks}), None, fractions)


def bet_fractions(*, by_start: bool, of_progress: bool) -> Floats:
    """Return the fractions of the bets for a kind of unit and a metric; they are part of the method, not of a plan."""
    if of_progress:
        return PROGRESS_MEAN_FRACTIONS if by_start else PROGRESS_FRACTIONS
    return MEAN_FRACTIONS if by_start else FRACTIONS


def unit_series(study: StudyFile, blocks: Sequence[Block], first: str, second: str | None) -> UnitSeries:
    """Return the values of a question's units up to the first incomplete one.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals, in the order of the schedule.
        first: first arm.
        second: second arm; None for a fixed rate.
    """
    values: list[float] = []
    counted: list[Block] = []
    for unit in _units(study, blocks):
        known = [block.values(study) for block in unit]
        if any(arm not in by_arm for by_arm in known for arm in (first, second) if arm is not None):
            break  # later units would break the random order
        values.append(float(np.mean([_value(by_arm, first, second) for by_arm in known])))
        counted += unit
    return UnitSeries(tuple(values), tuple(counted))


def _units(study: StudyFile, blocks: Sequence[Block]) -> list[list[Block]]:
    """Return the blocks of each unit, ordered by when the schedule completes the unit."""
    if study.of_these_cells:
        return [[block] for block in blocks]
    units: dict[int, list[Block]] = {}
    last: dict[int, int] = {}
    for place, block in enumerate(blocks):
        units.setdefault(block.start, []).append(block)
        last[block.start] = place
    return [units[start] for start in sorted(units, key=lambda start: last[start])]


def _value(by_arm: Mapping[str, float], first: str, second: str | None) -> float:
    if second is None:
        return float(by_arm[first])
    return float(as_share(float(by_arm[first]) - float(by_arm[second])))
