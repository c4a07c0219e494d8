"""Real against simulated: one model in both, on the goals and where possible the cells that both were tried in."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.compare import over_goals
from vsnbench.report.conditions import Condition, footnotes
from vsnbench.report.pairing import Pairing, pair, same_places
from vsnbench.report.record import goal_order
from vsnbench.report.sheets import (
    UNKNOWN,
    Cell,
    Column,
    Row,
    Sheet,
    count,
    decimal,
    interval_percent,
    kept,
    listed,
    of,
    percent,
    row,
    word,
)
from vsnbench.report.summary import ConditionSummary, Results, Summary
from vsnbench.statistics.agreement import Agreement, RankCorrelation, agreement, rank_correlation
from vsnbench.statistics.clustered import arrays, independent_difference
from vsnbench.statistics.paired import paired_interval
from vsnbench.statistics.prediction_powered import OnlyPredicted, Powered, PredictedCell, powered
from vsnbench.statistics.rates import Interval


@dataclass(frozen=True, slots=True)
class Twin:
    """One model for real and simulated."""

    real: Condition
    simulated: Condition
    goals: tuple[str, ...]
    """That both were asked for; the rest is about these alone."""
    first: Summary
    """Of the real trials."""
    second: Summary
    pairing: Pairing | None
    """None where the sites differ, or no cell is shared."""
    powered: Powered | None
    """What the simulated trials make of the real ones; None where they can add nothing."""

    @property
    def difference(self) -> float:
        """Real success rate less the simulated one, as a share; in shared cells the mean over them."""
        return self.pairing.outcomes.difference if self.pairing else self.first.success_rate - self.second.success_rate

    @property
    def interval(self) -> Interval:
        """Of the difference, 95 %."""
        if self.pairing:
            return paired_interval(self.pairing.outcomes)
        return independent_difference(self.first.outcomes, self.second.outcomes)

    @property
    def agreement(self) -> Agreement | None:
        """How far the twin's cells are the real ones'."""
        return agreement(self.pairing.outcomes) if self.pairing else None

    @property
    def ranks(self) -> RankCorrelation | None:
        """Whether the cells that are hard for real are hard for the twin."""
        if not self.pairing:
            return None
        sides = (self.pairing.outcomes.first, self.pairing.outcomes.second)
        return rank_correlation(*(arrays(side.cells)[1].tolist() for side in sides))


def twins(results: Results) -> tuple[Twin, ...]:
    """Return every model that has results both for real and simulated, on goals that both share."""
    return tuple(
        twin
        for real in results.conditions
        for simulated in results.conditions
        if _one_model(real.condition, simulated.condition) and (twin := _twin(real, simulated))
    )


def _one_model(real: Condition, simulated: Condition) -> bool:
    return (
        not real.simulated
        and simulated.simulated
        and (real.model, real.weights_sha256) == (simulated.model, simulated.weights_sha256)
    )


def _twin(real: ConditionSummary, simulated: ConditionSummary) -> Twin | None:
    shared = {goal.goal for goal in real.goals} & {goal.goal for goal in simulated.goals}
    if not shared:
        return None
    goals = tuple(sorted(shared, key=goal_order))
    return Twin(
        real=real.condition,
        simulated=simulated.condition,
        goals=goals,
        first=over_goals(real, goals),
        second=over_goals(simulated, goals),
        pairing=pair(real, simulated, goals),
        powered=_powered(real, simulated, goals),
    )


def _powered(real: ConditionSummary, simulated: ConditionSummary, goals: tuple[str, ...]) -> Powered | None:
    if not same_places(real.condition, simulated.condition):
        return None
    cells = [
        {(g.goal, cell.cluster): cell for g in one.goals if g.goal in goals for cell in g.summary.outcomes.cells}
        for one in (real, simulated)
    ]
    rates = {place: cell.successes / cell.trials for place, cell in cells[1].items() if place[1] > 0}
    driven = [PredictedCell(cell, rates[place]) for place, cell in cells[0].items() if place in rates]
    others = [OnlyPredicted(place[1], rate) for place, rate in rates.items() if place not in cells[0]]
    return powered(driven, others)


def real_sheet(found: Sequence[Twin]) -> Sheet | None:
    """Real against simulated (paper, Table 3), on the goals that both share; None when there is none."""
    if not found:
        return None
    return kept(
        Sheet(
            name="real-simulated",
            title="Real world against simulation",
            columns=(
                Column("model", number=False),
                Column("goals", number=False, rank=4),
                Column("real", number=False, rank=3),
                Column("k/n"),
                Column("SR %"),
                Column("95 % interval", rank=1),
                Column("done", rank=2),
                Column("simulated", number=False, rank=3),
                Column("k/n"),
                Column("SR %"),
                Column("95 % interval", rank=1),
                Column("done", rank=2),
                Column("real - sim.", note="difference in success rate, points; in shared cells the mean over them"),
                Column("95 % interval", note="Newcombe's interval of the difference, paired where cells are shared"),
                Column("shared cells", rank=2),
            ),
            rows=tuple(_real_row(one) for one in found),
            notes=(
                "On the goals that both were asked for.",
                *footnotes(list({side.number: side for one in found for side in (one.real, one.simulated)}.values())),
            ),
        )
    )


def _real_row(one: Twin) -> Row:
    a, b = one.first, one.second
    return row(
        word(one.real.model),
        word(listed(one.goals)),
        word(one.real.name),
        of(a.successes, a.episodes),
        percent(a.success_rate),
        interval_percent(a.interval.low, a.interval.high),
        of(a.episodes, a.planned),
        word(one.simulated.name),
        of(b.successes, b.episodes),
        percent(b.success_rate),
        interval_percent(b.interval.low, b.interval.high),
        of(b.episodes, b.planned),
        decimal(100 * one.difference, 2),
        interval_percent(one.interval.low, one.interval.high),
        count(len(one.pairing.outcomes.cells)) if one.pairing else Cell(UNKNOWN, -1),
    )


_POWERED = (
    "Prediction-powered (PPI++): what the twin says of the cells without real trials, corrected by how wrong it was "
    "where there are some. It holds where the driven cells were not chosen by their outcomes, and is no headline "
    "unless a study named it so before."
)


def twin_sheet(found: Sequence[Twin]) -> Sheet | None:
    """How true the simulated twin is cell by cell, and what it makes of few real trials; None without shared cells."""
    paired = [one for one in found if one.pairing]
    if not paired:
        return None
    return kept(
        Sheet(
            name="twin",
            title="The simulated twin, cell by cell",
            columns=(
                Column("real", number=False),
                Column("twin", number=False),
                Column("cells", note="that both were tried in"),
                Column("bias", note="the twin's success rate less the real one, points"),
                Column("error", note="root of the mean squared difference of a cell's rates, points"),
                Column("same outcome %", rank=1, note="of an episode of each in one cell"),
                Column("kappa", rank=2, note="agreement beyond chance"),
                Column("rank corr.", note="Spearman's, over the cells"),
                Column("95 % interval", rank=3),
                Column("real SR %", rank=1, note="mean over the cells with real trials"),
                Column("95 % interval", rank=1),
                Column("with the twin %", rank=1, note="prediction-powered, over all cells of the twin"),
                Column("95 % interval", rank=1),
                Column("tuning", rank=3, note="how far the twin is trusted, 0 to 1"),
                Column("cells saved", rank=1, note="real cells that would buy the same precision, less those driven"),
            ),
            rows=tuple(_twin_row(one) for one in paired),
            notes=(_POWERED,),
        )
    )


def _twin_row(one: Twin) -> Row:
    like, ranks, gain = one.agreement, one.ranks, one.powered
    if like is None or ranks is None:
        raise ValueError("a twin without shared cells has no row")
    unknown = decimal(float("nan"), 0)
    return row(
        word(one.real.name),
        word(one.simulated.name),
        count(like.cells),
        decimal(100 * like.bias, 1),
        decimal(100 * like.error, 1),
        percent(like.same, 1),
        decimal(like.kappa, 2),
        decimal(ranks.rho, 2),
        Cell(f"[{ranks.interval.low:.2f}, {ranks.interval.high:.2f}]") if ranks.interval.known else unknown,
        *(
            (
                percent(gain.plain_rate),
                interval_percent(gain.plain_interval.low, gain.plain_interval.high),
                percent(gain.rate),
                interval_percent(gain.interval.low, gain.interval.high),
                decimal(gain.tuning, 2),
                decimal(gain.saved, 1),
            )
            if gain
            else (unknown,) * 6
        ),
    )
