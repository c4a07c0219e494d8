"""Ranking of more than two models: one overall test, a letter display and rank intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.report.comparison.compare import SHARED, Comparison
from vsnbench.report.comparison.pairing import placed_cells, same_places
from vsnbench.statistics.clustered import Cell, Outcomes, arrays, rate_interval
from vsnbench.statistics.multiple import Ranks, letters, ranks
from vsnbench.statistics.permutation import exchange_models
from vsnbench.statistics.rates import Interval, Proportion


@dataclass(frozen=True, slots=True)
class RankedModel:
    """One of several models, on the goals and if possible the cells that all share."""

    condition: Condition
    proportion: Proportion
    interval: Interval
    letters: str
    """Two models share a letter exactly if their corrected comparison shows no difference."""
    ranks: Ranks


@dataclass(frozen=True, slots=True)
class Ranking:
    """Several models, best first."""

    goals: tuple[str, ...]
    models: tuple[RankedModel, ...]
    cells: int
    """Cells that all models share; 0 without shared cells."""
    starts: int
    p: float | None
    """p-value of "no model differs from the others"; None without shared cells."""
    pairs: int
    """Number of p-values in the correction of the pairs."""


def ranking_of(members: Sequence[ConditionSummary], comparisons: Sequence[Comparison]) -> Ranking | None:
    """Rank three or more models; None for fewer, or without a goal shared by all."""
    shared = set.intersection(*(set(summary.own_goals) for summary in members)) if members else set()
    if len(members) < 3 or not shared:
        return None
    goals = tuple(sorted(shared, key=goal_order))
    cells, rates = _common_cells(members, goals)
    outcomes = [
        Outcomes(tuple(several[n] for several in cells.values())) if cells else summary.over(goals).outcomes
        for n, summary in enumerate(members)
    ]
    order = sorted(range(len(members)), key=lambda n: (-outcomes[n].proportion.rate, members[n].condition.number))
    verdict = _verdicts(comparisons)
    numbers = [members[n].condition.number for n in order]

    def better(i: int, j: int) -> bool:
        return verdict.get((numbers[i], numbers[j]), 0) > 0

    signs = letters(len(order), lambda i, j: better(i, j) or better(j, i))
    places = ranks(len(order), better)
    return Ranking(
        goals=goals,
        models=tuple(
            RankedModel(members[n].condition, outcomes[n].proportion, rate_interval(outcomes[n]), sign, place)
            for n, sign, place in zip(order, signs, places, strict=True)
        ),
        cells=len(cells),
        starts=len(rates),
        p=exchange_models(rates) if cells else None,
        pairs=max((comparison.asked for comparison in comparisons), default=0),
    )


def _common_cells(
    members: Sequence[ConditionSummary], goals: Sequence[str]
) -> tuple[dict[tuple[str, int], list[Cell]], npt.NDArray[np.float64]]:
    """Return the cells of all members by goal and start, in order, and (starts, members) sums of their rates."""
    first = members[0].condition
    if not all(same_places(first, summary.condition) for summary in members):
        return {}, np.empty((0, len(members)))
    by_place = [placed_cells(summary, goals) for summary in members]
    common = set.intersection(*(set(cells_of_model) for cells_of_model in by_place))
    ordered = sorted(common, key=lambda place: (goals.index(place[0]), place[1]))
    cells = {place: [cells_of_model[place] for cells_of_model in by_place] for place in ordered}
    if not cells:
        return {}, np.empty((0, len(members)))
    starts = sorted({start for _, start in cells})
    rates = np.zeros((len(starts), len(members)))
    for (_, start), several in cells.items():
        rates[starts.index(start)] += arrays(several)[1]
    return cells, rates


def _verdicts(comparisons: Sequence[Comparison]) -> dict[tuple[int, int], int]:
    """Return, for each ordered pair found different on the shared goals, 1 if the first is better, else -1."""
    found = {}
    for comparison in comparisons:
        for rate in comparison.rates:
            if rate.scope == SHARED and (sign := rate.conclusion.sign):
                found[comparison.first.number, comparison.second.number] = sign
                found[comparison.second.number, comparison.first.number] = -sign
    return found
