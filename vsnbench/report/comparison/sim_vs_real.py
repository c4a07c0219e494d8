"""Real against simulated trials of one model, on the shared goals and if possible the shared cells."""

from dataclasses import dataclass

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.summary import ConditionSummary, Group, ReportResults
from vsnbench.report.comparison.pairing import (
    Pairing,
    difference_interval,
    pair,
    placed_cells,
    rate_difference,
    same_places,
)
from vsnbench.statistics.agreement import Agreement, RankCorrelation, agreement, rank_correlation
from vsnbench.statistics.clustered import arrays
from vsnbench.statistics.prediction_powered import OnlyPredicted, Powered, PredictedCell, powered
from vsnbench.statistics.rates import Interval


@dataclass(frozen=True, slots=True)
class SimRealPair:
    """One model with real and simulated trials."""

    real: Condition
    simulated: Condition
    goals: tuple[str, ...]
    """Goals with both real and simulated trials; the other fields are about these goals."""
    first: Group
    """Group of the real trials."""
    second: Group
    pairing: Pairing | None
    """None if the sites differ or no cell is shared."""
    powered: Powered | None
    """Prediction-powered estimate; None if the simulated trials add nothing."""

    @property
    def difference(self) -> float:
        """Real success rate minus the simulated one; for shared cells the mean over them."""
        return rate_difference(self.pairing, self.first, self.second)

    @property
    def interval(self) -> Interval:
        """95 % interval of the difference."""
        return difference_interval(self.pairing, self.first, self.second)

    @property
    def agreement(self) -> Agreement | None:
        """Agreement of the shared cells."""
        return agreement(self.pairing.outcomes) if self.pairing else None

    @property
    def ranks(self) -> RankCorrelation | None:
        """Rank correlation of the rates of the shared cells, with an interval clustered by starting position."""
        if not self.pairing:
            return None
        clusters, real, _ = arrays(self.pairing.outcomes.first.cells)
        simulated = arrays(self.pairing.outcomes.second.cells)[1]
        return rank_correlation(real.tolist(), simulated.tolist(), clusters.tolist())


def sim_real_pairs(results: ReportResults, *, by_goal: bool = False) -> tuple[SimRealPair, ...]:
    """Return every model that has both real and simulated results, on the shared goals, or on one at a time."""
    found = []
    for real in results.conditions:
        for simulated in results.conditions:
            if _one_model(real.condition, simulated.condition):
                shared = sorted(set(real.own_goals) & set(simulated.own_goals), key=goal_order)
                groups = [(goal,) for goal in shared] if by_goal else [tuple(shared)]
                found += [_pair_of(real, simulated, goals) for goals in groups if goals]
    return tuple(found)


def _one_model(real: Condition, simulated: Condition) -> bool:
    return (
        not real.simulated
        and simulated.simulated
        and (real.model, real.weights_sha256) == (simulated.model, simulated.weights_sha256)
    )


def _pair_of(real: ConditionSummary, simulated: ConditionSummary, goals: tuple[str, ...]) -> SimRealPair:
    return SimRealPair(
        real=real.condition,
        simulated=simulated.condition,
        goals=goals,
        first=real.over(goals),
        second=simulated.over(goals),
        pairing=pair(real, simulated, goals),
        powered=_powered(real, simulated, goals),
    )


def _powered(real: ConditionSummary, simulated: ConditionSummary, goals: tuple[str, ...]) -> Powered | None:
    if not same_places(real.condition, simulated.condition):
        return None
    cells = placed_cells(real, goals)
    rates = {place: cell.successes / cell.trials for place, cell in placed_cells(simulated, goals).items()}
    driven = [PredictedCell(cell, rates[place]) for place, cell in cells.items() if place in rates]
    others = [OnlyPredicted(place[1], rate) for place, rate in rates.items() if place not in cells]
    return powered(driven, others)
