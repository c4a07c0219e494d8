"""More than two models at once: one test over all, then which can be told apart, and between which ranks each lies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.report.compare import SHARED, Comparison, over_goals
from vsnbench.report.conditions import Condition
from vsnbench.report.pairing import same_places
from vsnbench.report.record import goal_order
from vsnbench.report.summary import ConditionSummary
from vsnbench.statistics.clustered import Cell, Outcomes, arrays, rate_interval
from vsnbench.statistics.multiple import Ranks, letters, ranks
from vsnbench.statistics.permutation import exchange_models
from vsnbench.statistics.rates import Interval, Proportion


@dataclass(frozen=True, slots=True)
class Standing:
    """One model among several, on the goals, and where possible the cells, that all of them share."""

    condition: Condition
    proportion: Proportion
    interval: Interval
    letters: str
    """Two models share one exactly when the corrected comparison of the pair does not tell them apart."""
    ranks: Ranks


@dataclass(frozen=True, slots=True)
class Contest:
    """Several models, the best first."""

    goals: tuple[str, ...]
    standings: tuple[Standing, ...]
    cells: int
    """That all of them were tried in; 0 where they share none."""
    starts: int
    p: float | None
    """Of "no model differs from the others"; None where they share no cells."""
    pairs: int
    """How many p-values the pairs were corrected for."""


def contest_of(members: Sequence[ConditionSummary], comparisons: Sequence[Comparison]) -> Contest | None:
    """Lay three or more models beside each other; None for fewer, or where no goal is shared by all.

    Args:
        members: the conditions, each once.
        comparisons: of every pair of them, already corrected together.
    """
    shared = set.intersection(*({goal.goal for goal in one.goals} for one in members)) if members else set()
    if len(members) < 3 or not shared:
        return None
    goals = tuple(sorted(shared, key=goal_order))
    cells, rates = _common_cells(members, goals)
    outcomes = [
        Outcomes(tuple(cells[place][n] for place in sorted(cells))) if cells else over_goals(one, goals).outcomes
        for n, one in enumerate(members)
    ]
    order = sorted(range(len(members)), key=lambda n: (-outcomes[n].proportion.rate, members[n].condition.number))
    verdict = _verdicts(comparisons)
    numbers = [members[n].condition.number for n in order]

    def better(i: int, j: int) -> bool:
        return verdict.get((numbers[i], numbers[j]), 0) > 0

    signs = letters(len(order), lambda i, j: better(i, j) or better(j, i))
    places = ranks(len(order), better)
    return Contest(
        goals=goals,
        standings=tuple(
            Standing(members[n].condition, outcomes[n].proportion, rate_interval(outcomes[n]), sign, place)
            for n, sign, place in zip(order, signs, places, strict=True)
        ),
        cells=len(cells),
        starts=len(rates),
        p=exchange_models(rates) if cells else None,
        pairs=max((one.asked for one in comparisons), default=0),
    )


def _common_cells(
    members: Sequence[ConditionSummary], goals: Sequence[str]
) -> tuple[dict[tuple[int, int], list[Cell]], npt.NDArray[np.float64]]:
    """Return the cells of all members by (goal's place, start), and (starts, members) sums of their rates."""
    first = members[0].condition
    if not all(same_places(first, one.condition) for one in members):
        return {}, np.empty((0, len(members)))
    by_place = []
    for one in members:
        summaries = {goal.goal: goal.summary for goal in one.goals}
        by_place.append(
            {
                (n, cell.cluster): cell
                for n, goal in enumerate(goals)
                for cell in summaries[goal].outcomes.cells
                if cell.cluster > 0
            }
        )
    common = set.intersection(*(set(each) for each in by_place))
    cells = {place: [each[place] for each in by_place] for place in sorted(common)}
    if not cells:
        return {}, np.empty((0, len(members)))
    starts = sorted({start for _, start in cells})
    rates = np.zeros((len(starts), len(members)))
    for (_, start), several in cells.items():
        rates[starts.index(start)] += arrays(several)[1]
    return cells, rates


def _verdicts(comparisons: Sequence[Comparison]) -> dict[tuple[int, int], int]:
    """Return, for each ordered pair of conditions found different on the shared goals, 1 where the first is better."""
    found = {}
    for one in comparisons:
        for rate in one.rates:
            if rate.scope == SHARED and rate.covered and rate.significant:
                sign = 1 if rate.difference > 0 else -1
                found[one.first.number, one.second.number] = sign
                found[one.second.number, one.first.number] = -sign
    return found
