"""Sensitivity analyses: other rules, shortest path, seed, drift, cells."""

from collections.abc import Iterable, Sequence

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.sensitivity import (
    Drift,
    Recount,
    by_distance,
    by_seed,
    drift,
    grid,
    sensitivity,
    spread_between,
)
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.measures import (
    COUNT,
    FLAG,
    NUMBER,
    TEXT,
    Measure,
    Measures,
    an_object,
    intervals,
    objects,
    rates,
)
from vsnbench.report.table import EMPTY, Column, ReportTable, TableCell, of, row
from vsnbench.report.wording import compared

RECOUNT = Measures.shared(
    "recount",
    Measure("counted", TEXT, "rule or part of the episodes", "label"),
    *rates("proportion", "interval"),
    Measure(
        "bound",
        FLAG,
        "missing trials are counted as all failed or all succeeded",
        lambda recount: bool(recount.bound),
    ),
)
_LATER = "share of pairs of a success and a failure in which the success is later; 0.5 without a trend"
DRIFT = Measures.shared(
    "drift",
    Measure("p", NUMBER, "p-value of no trend", "trend.p"),
    Measure("least_p", NUMBER, "smallest p-value that the design can give", "trend.least_p"),
    Measure("exact", FLAG, "the p-value is exact", "trend.exact"),
    Measure("success_later", NUMBER, _LATER, "trend.later", null="without pairs"),
    Measure("difference", NUMBER, "success rate of the last third minus that of the first"),
    Measure("ci", intervals(), "the 95 % interval of the difference", "interval"),
    Measure("thirds", objects(RECOUNT), "recounts of the first, second and last third"),
)
_CELLS = Measures(
    Measure("goal", TEXT, "goal of the cell", lambda cell: cell[0][0]),
    Measure("start", COUNT, "number of the starting position", lambda cell: cell[0][1]),
    Measure("successes", COUNT, "successes in the cell", lambda cell: cell[1].successes),
    Measure("episodes", COUNT, "counted episodes in the cell", lambda cell: cell[1].trials),
)
_Part = tuple[ReportData, ConditionSummary]


def _has_sessions(part: _Part) -> bool:
    """Whether success can drift: of real robots and in rehearsals, because simulations do not."""
    record, summary = part
    return not summary.condition.simulated or bool((record.of(summary.condition)["session"] > 0).any())


_WITHIN = "in simulation without sessions, and with fewer than 12 episodes"
_OVER_ALL = "in simulation without sessions, or with one session"
SENSITIVITY = Measures(
    Measure("recounts", objects(RECOUNT), "as judged, and under other rules", lambda part: sensitivity(*part)),
    Measure(
        "by_shortest_path",
        objects(RECOUNT),
        "by length of the shortest path to the goal",
        lambda part: by_distance(*part),
    ),
    Measure("by_seed", objects(RECOUNT), "one recount per seed; empty with one seed", lambda part: by_seed(*part)),
    Measure(
        "standard_deviation_between_seeds",
        NUMBER,
        "standard deviation of the seeds' success rates",
        lambda part: spread_between(by_seed(*part)),
        null="with one seed",
    ),
    Measure(
        "drift",
        an_object(DRIFT),
        "change of success within sessions",
        lambda part: drift(*part) if _has_sessions(part) else None,
        null=_WITHIN,
    ),
    Measure(
        "drift_over_all_sessions",
        an_object(DRIFT),
        "change of success over all sessions",
        lambda part: drift(*part, whole=True) if _has_sessions(part) else None,
        null=_OVER_ALL,
    ),
    Measure("cells", objects(_CELLS), "counts, one object per cell", lambda part: grid(part[1]).cells.items()),
)
"""The JSON object of a condition's sensitivity analyses, from the record and the condition's summary."""


def sensitivity_tables(record: ReportData, results: ReportResults) -> list[ReportTable]:
    """Return every sensitivity table that the record supports."""
    tables = [
        _groups(
            "sensitivity",
            "Sensitivity of the success rates to the counting rule",
            "rule",
            ((summary, sensitivity(record, summary)) for summary in results.conditions),
            "The intervals do not cover the choice of the rule. Bounds for missing trials are not estimates.",
        ),
        _groups(
            "distances",
            "Success by the length of the shortest path",
            "shortest path",
            ((summary, by_distance(record, summary)) for summary in results.conditions),
            "A trial that begins within one move of success is trivial and not informative about navigation.",
        ),
        _seeds(record, results),
        drift_table(record, results),
        *(_grid(summary) for summary in results.conditions if len(grid(summary).goals) > 1),
    ]
    return [table for table in tables if table is not None and table.rows]


def _groups(
    name: str, title: str, heading: str, members: Iterable[tuple[ConditionSummary, Sequence[Recount]]], *notes: str
) -> ReportTable:
    return ReportTable(
        name=name,
        title=title,
        columns=(Column("model", number=False), Column(heading, number=False), *RECOUNT.columns),
        rows=tuple(
            RECOUNT.row(recount, TableCell(summary.condition.name), TableCell(recount.label))
            for summary, groups in members
            for recount in groups
        ),
        notes=notes,
    )


def _seeds(record: ReportData, results: ReportResults) -> ReportTable:
    groups = [(summary, by_seed(record, summary)) for summary in results.conditions]
    spreads = [
        f"{summary.condition.name}: the seeds' rates have a standard deviation of "
        f"{100 * spread_between(mine):.1f} points."
        for summary, mine in groups
        if len(mine) > 1
    ]
    return _groups("seeds", "Success by seed", "seed", groups, *spreads)


def drift_table(record: ReportData, results: ReportResults) -> ReportTable:
    """Return the drift over sessions; only for real robots and rehearsals, because simulations do not drift."""
    with_sessions = set(record.episodes.loc[record.episodes["session"] > 0, "condition"])
    asked = [
        summary
        for summary in results.conditions
        if not summary.condition.simulated or summary.condition.number in with_sessions
    ]
    found = [
        (summary, mine) for summary in asked for whole in (False, True) if (mine := drift(record, summary, whole=whole))
    ]
    notes = [f"{summary.condition.name}, over {mine.over}: {_drifted(mine)}" for summary, mine in found]
    return _groups("drift", "Success over time", "part", ((summary, mine.thirds) for summary, mine in found), *notes)


def _drifted(mine: Drift) -> str:
    text = ""
    if mine.interval.known:
        low, high = 100 * mine.interval.low, 100 * mine.interval.high
        text = f"last third minus first third {100 * mine.difference:+.1f} points [{low:+.1f}, {high:+.1f}], "
    text += f"p {compared(mine.trend.p)}{'' if mine.trend.exact else ' (normal approximation)'}"
    if mine.trend.least_p > 0.05:
        return f"{text}; with so few outcomes no order of them could have shown a drift."
    return f"{text} for no change of success with time, stratified by goal."


def _grid(summary: ConditionSummary) -> ReportTable:
    cells = grid(summary)
    return ReportTable(
        name=f"grid-{summary.condition.number}",
        title=f"{summary.condition.name}: success by starting position and goal",
        columns=(Column("start"), *(Column(goal) for goal in cells.goals)),
        rows=tuple(
            row(
                start,
                *(
                    of(mine.successes, mine.trials) if (mine := cells.cells.get((goal, start))) else EMPTY
                    for goal in cells.goals
                ),
            )
            for start in cells.starts
        ),
        condition=summary.condition.number,
    )
