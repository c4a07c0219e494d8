"""Tables of sensitivity analyses, failures and overruled verdicts."""

from collections.abc import Iterable, Sequence

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import Failures
from vsnbench.report.analysis.judgements import Judgements
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
from vsnbench.report.analysis.summary import ConditionSummary, Results
from vsnbench.report.table import EMPTY, Column, ReportTable, Row, interval_percent, of, percent, row
from vsnbench.report.wording import compared
from vsnbench.text.sanitize import sanitize

_RATES = (Column("k/n"), Column("SR %"), Column("95 % interval"))
_NAMED = 5
"""Number of overruled verdicts named in a note."""


def sensitivity_tables(record: ReportData, results: Results) -> list[ReportTable]:
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
        columns=(Column("model", number=False), Column(heading, number=False), *_RATES),
        rows=tuple(_row(summary, recount) for summary, groups in members for recount in groups),
        notes=notes,
    )


def _row(summary: ConditionSummary, recount: Recount) -> Row:
    proportion, interval = recount.proportion, recount.interval
    return row(
        summary.condition.name,
        recount.label,
        of(proportion.successes, proportion.trials),
        percent(proportion.rate),
        interval_percent(interval) if interval else EMPTY,
    )


def _seeds(record: ReportData, results: Results) -> ReportTable:
    groups = [(summary, by_seed(record, summary)) for summary in results.conditions]
    spreads = [
        f"{summary.condition.name}: the seeds' rates have a standard deviation of "
        f"{100 * spread_between(mine):.1f} points."
        for summary, mine in groups
        if len(mine) > 1
    ]
    return _groups("seeds", "Success by seed", "seed", groups, *spreads)


def drift_table(record: ReportData, results: Results) -> ReportTable:
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


def failure_table(results: Results, failures: Sequence[Failures]) -> ReportTable | None:
    """Return the table of failure causes; None without failures."""
    by_number = {summary.condition.number: summary for summary in results.conditions}
    rows, notes = [], []
    for counts in failures:
        summary = by_number[counts.condition]
        rows += [
            row(
                summary.condition.name,
                kind.value,
                number,
                percent(number / counts.examined, 1),
            )
            for kind, number in counts.kinds
        ]
        if counts.examined < counts.failed:
            notes.append(f"{summary.condition.name}: {counts.examined} of {counts.failed} failures, evenly sampled.")
        if counts.never_in_view is not None:
            notes.append(
                f"{summary.condition.name}: the goal was never in view in {counts.never_in_view} of these failures."
            )
        if counts.touched:
            things = ", ".join(f"{sanitize(thing)} {times}" for thing, times in counts.touched)
            notes.append(f"{summary.condition.name} collided with: {things}.")
    if not rows:
        return None
    return ReportTable(
        name="failures",
        title="Why episodes failed",
        columns=(
            Column("model", number=False),
            Column("kind", number=False),
            Column("episodes"),
            Column("% of examined"),
        ),
        rows=tuple(rows),
        notes=(*notes, "From the poses and the site's walls; furniture does not block the view in this analysis."),
    )


def judgement_table(results: Results, judgements: Sequence[Judgements]) -> ReportTable | None:
    """Return the table of verdicts that operators overruled; None if no operator judged."""
    by_number = {summary.condition.number: summary for summary in results.conditions}
    rows, notes = [], []
    for judged in judgements:
        summary = by_number[judged.condition]
        to_success = sum(change.after is True for change in judged.overruled)
        to_failure = sum(change.after is False for change in judged.overruled)
        rows.append(
            row(
                summary.condition.name,
                judged.judged,
                len(judged.overruled),
                percent(judged.rate, 1),
                to_success,
                to_failure,
                len(judged.overruled) - to_success - to_failure,
            )
        )
        for change in judged.overruled[:_NAMED]:
            became = {True: "a success", False: "a failure", None: "void"}[change.after]
            notes.append(f"Episode {change.episode}: {became} by {sanitize(change.author)}: {sanitize(change.reason)}.")
        if len(judged.overruled) > _NAMED:
            notes.append(f"{len(judged.overruled) - _NAMED} more for {summary.condition.name}.")
    if not rows:
        return None
    return ReportTable(
        name="judgements",
        title="Verdicts by operators",
        columns=(
            Column("model", number=False),
            Column("judged"),
            Column("overruled"),
            Column("%"),
            Column("to success"),
            Column("to failure"),
            Column("to void"),
        ),
        rows=tuple(rows),
        notes=tuple(notes),
    )
