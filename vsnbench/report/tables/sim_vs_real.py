"""Tables of real against simulated trials."""

from collections.abc import Sequence

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.sim_vs_real import SimRealPair
from vsnbench.report.table import (
    EMPTY,
    Column,
    ReportTable,
    Row,
    decimal,
    interval_cell,
    interval_percent,
    of,
    percent,
    rate_cells,
    row,
    without_empty_columns,
)
from vsnbench.report.wording import listed
from vsnbench.statistics.agreement import Agreement, RankCorrelation
from vsnbench.statistics.bootstrap import MIN_CLUSTERS


def sim_vs_real_table(found: Sequence[SimRealPair]) -> ReportTable | None:
    """Real against simulated results (paper, Table 3) on the shared goals; None if there are none."""
    if not found:
        return None
    return without_empty_columns(
        ReportTable(
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
                Column("real - sim.", note="difference in success rate, points; for shared cells the mean over them"),
                Column("95 % interval", note="Newcombe's interval of the difference, paired for shared cells"),
                Column("shared cells", rank=2),
            ),
            rows=tuple(_real_row(pair) for pair in found),
            notes=(
                "On the goals with both real and simulated trials.",
                *footnotes(
                    list({side.number: side for pair in found for side in (pair.real, pair.simulated)}.values())
                ),
            ),
        )
    )


def _real_row(pair: SimRealPair) -> Row:
    a, b = pair.first, pair.second
    return row(
        pair.real.model,
        listed(pair.goals),
        pair.real.name,
        *rate_cells(a.proportion, a.interval),
        of(a.episodes, a.planned),
        pair.simulated.name,
        *rate_cells(b.proportion, b.interval),
        of(b.episodes, b.planned),
        decimal(100 * pair.difference, 2),
        interval_percent(pair.interval),
        len(pair.pairing.outcomes.cells) if pair.pairing else EMPTY,
    )


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
    return without_empty_columns(
        ReportTable(
            name="cell-agreement",
            title="Real and simulated results, cell by cell",
            columns=(
                Column("real", number=False),
                Column("simulated", number=False),
                Column("cells", note="shared cells"),
                Column("bias", note="simulated success rate minus the real one, points"),
                Column("error", note="root mean square difference of the rates of a cell, points"),
                Column("same outcome %", rank=1, note="probability that a real and a simulated episode agree"),
                Column("kappa", rank=2, note="Cohen's kappa: agreement beyond chance"),
                Column("rank corr.", note="Spearman's rank correlation over the cells"),
                Column(
                    "95 % interval",
                    rank=3,
                    note=f"jackknife over starting positions, unknown for fewer than {MIN_CLUSTERS}",
                ),
                Column("real SR %", rank=1, note="mean over the cells with real trials"),
                Column("95 % interval", rank=1),
                Column("PPI++ SR %", rank=1, note="prediction-powered success rate over all simulated cells"),
                Column("95 % interval", rank=1),
                Column("tuning", rank=3, note="weight of the simulated results, 0 to 1"),
                Column("cells saved", rank=1, note="additional real cells that would give the same precision"),
            ),
            rows=rows,
            notes=(_POWERED,),
        )
    )


def _agreement_row(pair: SimRealPair, like: Agreement, ranks: RankCorrelation) -> Row:
    gain = pair.powered
    return row(
        pair.real.name,
        pair.simulated.name,
        like.cells,
        decimal(100 * like.bias, 1),
        decimal(100 * like.error, 1),
        percent(like.same, 1),
        decimal(like.kappa, 2),
        decimal(ranks.rho, 2),
        interval_cell(ranks.interval, 2),
        *(
            (
                percent(gain.plain_rate),
                interval_percent(gain.plain_interval),
                percent(gain.rate),
                interval_percent(gain.interval),
                decimal(gain.tuning, 2),
                decimal(gain.saved, 1),
            )
            if gain
            else (EMPTY,) * 6
        ),
    )
