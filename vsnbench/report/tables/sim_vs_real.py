"""Real against simulated trials."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.comparison.pairing import same_places
from vsnbench.report.comparison.sim_vs_real import SimRealPair
from vsnbench.report.measures import (
    COUNT,
    RATIO,
    TEXT,
    TEXTS,
    Form,
    Measure,
    Measures,
    an_object,
    decimals,
    intervals,
    percents,
    rates,
)
from vsnbench.report.table import EMPTY, Column, ReportTable, Row, TableCell, decimal, row, without_empty_columns
from vsnbench.report.wording import listed
from vsnbench.statistics.agreement import Agreement, RankCorrelation
from vsnbench.statistics.bootstrap import MIN_CLUSTERS

_POINTS = decimals(1, 100)
_SAME = "probability that a real and a simulated episode agree"
AGREEMENT = Measures(
    Measure(
        "bias",
        _POINTS,
        "simulated success rate minus the real one, mean over the cells",
        heading="bias",
        note="simulated success rate minus the real one, points",
    ),
    Measure(
        "error",
        _POINTS,
        "root mean square difference of the cells' rates",
        heading="error",
        note="root mean square difference of the rates of a cell, points",
    ),
    Measure("same", percents(1), _SAME, heading="same outcome %", rank=1),
    Measure("kappa", decimals(2), "Cohen's kappa: agreement beyond chance", heading="kappa", rank=2),
)
_JACKKNIFE = f"jackknife over starting positions, unknown for fewer than {MIN_CLUSTERS}"
RANKS = Measures(
    Measure("rho", decimals(2), "Spearman's rank correlation over the cells", heading="rank corr."),
    Measure(
        "ci",
        intervals(2, 1),
        "the 95 % interval of rho",
        "interval",
        heading="95 % interval",
        note=_JACKKNIFE,
        rank=3,
    ),
)
_PLAIN, _WITH = "mean over the cells with real trials", "prediction-powered success rate over all simulated cells"
_TUNING, _SAVED = "weight of the simulated results, 0 to 1", "additional real cells that would give the same precision"
_CI, _ONE_PLACE = "95 % interval", Form({"type": "number"}, lambda cells: decimal(cells, 1))
_TWO_PLACES = Form({"type": "number"}, lambda tuning: decimal(tuning, 2))
POWERED = Measures(
    Measure("success_rate", percents(), _WITH, "rate", heading="PPI++ SR %", rank=1),
    Measure("ci", intervals(), "the 95 % interval of this rate", "interval", heading=_CI, note="", rank=1),
    Measure("plain_success_rate", percents(), _PLAIN, "plain_rate", heading="real SR %", rank=1),
    Measure("plain_ci", intervals(), "its 95 % interval", "plain_interval", heading=_CI, note="", rank=1),
    Measure("tuning", _TWO_PLACES, _TUNING, heading="tuning", rank=3),
    Measure("cells", COUNT, "number of cells with real trials"),
    Measure("cells_saved", _ONE_PLACE, _SAVED, "saved", heading="cells saved", rank=1),
).in_columns("real SR %", "plain_ci", "PPI++ SR %", "ci", "tuning", "cells saved")
_ESTIMATE = "real success rate estimated with the help of simulation"


def _cells(pair: SimRealPair) -> int:
    return len(pair.pairing.outcomes.cells) if pair.pairing else 0


def _rates(side: str, name: str) -> tuple[Measure, ...]:
    """Return the measures of the real (`first`) or simulated (`second`) trials."""

    def group(pair: SimRealPair) -> Any:
        return getattr(pair, side)

    k_of_n, rate, interval = rates(lambda pair: group(pair).proportion, lambda pair: group(pair).interval)[2:]
    return (
        Measure(
            f"successes_{name}",
            COUNT,
            f"successes of the {name} condition on these goals",
            lambda pair: group(pair).successes,
        ),
        Measure(
            f"episodes_{name}",
            COUNT,
            f"counted episodes of the {name} condition on these goals",
            lambda pair: group(pair).episodes,
        ),
        k_of_n,
        replace(rate, key=""),
        replace(interval, key="", rank=1),
        Measure("", RATIO, of=lambda pair: (group(pair).episodes, group(pair).planned), heading="done", rank=2),
    )


_DIFFERENCE = "real success rate minus the simulated one; for shared cells the mean over them"
_NEWCOMBE = "Newcombe's interval of the difference, paired for shared cells"
_POINTS_NOTE = "difference in success rate, points; for shared cells the mean over them"
SIM_VS_REAL = Measures.shared(
    "sim_vs_real",
    Measure("real", TEXT, "name of the real condition", "real.name"),
    Measure("simulated", TEXT, "name of the simulated condition", "simulated.name"),
    Measure("goals", TEXTS, "goals with real and simulated trials"),
    Measure("", TEXT, of="real.model", heading="model"),
    Measure("", TEXT, of=lambda pair: listed(pair.goals), heading="goals", rank=4),
    Measure("", TEXT, of="real.name", heading="real", rank=3),
    *_rates("first", "real"),
    Measure("", TEXT, of="simulated.name", heading="simulated", rank=3),
    *_rates("second", "simulated"),
    Measure("difference", decimals(2, 100), _DIFFERENCE, heading="real - sim.", note=_POINTS_NOTE),
    Measure(
        "ci",
        intervals(),
        "the 95 % interval of the difference",
        "interval",
        heading="95 % interval",
        note=_NEWCOMBE,
    ),
    Measure("shared_cells", COUNT, "number of cells that both conditions have", _cells),
    Measure("", COUNT, of=lambda pair: _cells(pair) or None, heading="shared cells", rank=2),
    Measure("agreement", an_object(AGREEMENT), "agreement of the shared cells", null="without any"),
    Measure(
        "rank_correlation", an_object(RANKS), "correlation of the shared cells' rates", "ranks", null="without any"
    ),
    Measure("prediction_powered", an_object(POWERED), _ESTIMATE, "powered", null="if the simulation adds nothing"),
)


def sim_vs_real_table(found: Sequence[SimRealPair]) -> ReportTable | None:
    """Real against simulated results (paper, Table 3) on the shared goals; None if there are none."""
    if not found:
        return None
    sides = list({side.number: side for pair in found for side in (pair.real, pair.simulated)}.values())
    notes = ("On the goals with both real and simulated trials.", *footnotes(sides))
    table = SIM_VS_REAL.table("real-simulated", "Real world against simulation", found, notes=notes)
    return without_empty_columns(table)


_BY_GOAL = Measures(*(measure for measure in SIM_VS_REAL if measure.heading not in ("", "goals", "real", "simulated")))


def twin_goal_table(found: Sequence[SimRealPair]) -> ReportTable | None:
    """Reality, scan and drawn twin of a site by goal; None unless a site has simulated results of both.

    Args:
        found: real and simulated results on one goal at a time.
    """
    twins: dict[str, set[str]] = {}
    for pair in found:
        if same_places(pair.real, pair.simulated):
            twins.setdefault(pair.real.places_sha256, set()).add(pair.simulated.twin)
    shown = [pair for pair in found if len(twins.get(pair.real.places_sha256, ())) > 1]
    if not shown:
        return None
    shown.sort(key=lambda pair: (pair.real.number, goal_order(pair.goals[0]), pair.simulated.twin))
    columns = (Column("goal", number=False), Column("twin", number=False), *_BY_GOAL.columns, *POWERED.columns)
    rows = tuple(
        row(listed(pair.goals), pair.simulated.twin, *_BY_GOAL.cells(pair), *_powered_cells(pair)) for pair in shown
    )
    sides = list({side.number: side for pair in shown for side in (pair.real, pair.simulated)}.values())
    title = "Real world against scan and drawn twin, by goal"
    return without_empty_columns(ReportTable("twins", title, columns, rows, (_POWERED, *footnotes(sides))))


def _powered_cells(pair: SimRealPair) -> tuple[TableCell, ...]:
    return POWERED.cells(pair.powered) if pair.powered else (EMPTY,) * len(POWERED.columns)


_POWERED = (
    "Prediction-powered inference (PPI++): the simulated rate of the cells without real trials, corrected by the "
    "simulation error in the cells with real trials. Valid only if these cells were drawn at random; convenient "
    "starting positions bias it; not a primary result unless the study plan names it."
)


def cell_agreement_table(found: Sequence[SimRealPair]) -> ReportTable | None:
    """Agreement of real and simulated cells, and the prediction-powered rate; None without shared cells."""
    rows = tuple(
        _agreement_row(pair, like, ranks) for pair in found if (like := pair.agreement) and (ranks := pair.ranks)
    )
    if not rows:
        return None
    first = (Column("real", number=False), Column("simulated", number=False), Column("cells", note="shared cells"))
    columns = (*first, *AGREEMENT.columns, *RANKS.columns, *POWERED.columns)
    title = "Real and simulated results, cell by cell"
    return without_empty_columns(ReportTable("cell-agreement", title, columns, rows, (_POWERED,)))


def _agreement_row(pair: SimRealPair, like: Agreement, ranks: RankCorrelation) -> Row:
    values = (*AGREEMENT.cells(like), *RANKS.cells(ranks), *_powered_cells(pair))
    return row(pair.real.name, pair.simulated.name, like.cells, *values)
