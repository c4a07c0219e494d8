"""What a reviewer asks, as sheets; each is there where the record supports it."""

from collections.abc import Iterable, Sequence

from vsnbench.harmless_text import harmless
from vsnbench.report.failures import Failures
from vsnbench.report.judgements import Judgements
from vsnbench.report.record import Record
from vsnbench.report.scrutiny import Drift, Recount, by_distance, by_seed, drift, grid, sensitivity, spread_between
from vsnbench.report.sheets import UNKNOWN, Cell, Column, Row, Sheet, count, interval_percent, of, percent, row, word
from vsnbench.report.summary import ConditionSummary, Results
from vsnbench.report.verdicts import compared

_RATES = (Column("k/n"), Column("SR %"), Column("95 % interval"))
_NAMED = 5
"""Overrulings that are named in a note; the record has all."""


def scrutiny_sheets(record: Record, results: Results) -> list[Sheet]:
    """Return every sheet that the episodes alone support."""
    sheets = [
        _groups(
            "sensitivity",
            "Would the rates hold? Counted anew under other rules",
            "counted",
            ((one, sensitivity(record, one)) for one in results.conditions),
            "The interval does not cover the choice of the rule. Bounds for missing trials are no estimates.",
        ),
        _groups(
            "distances",
            "Success by the length of the shortest path",
            "shortest path",
            ((one, by_distance(record, one)) for one in results.conditions),
            "A trial that begins within one move of success is trivial and tells nothing about navigation.",
        ),
        _seeds(record, results),
        drift_sheet(record, results),
        *(_grid(one) for one in results.conditions if len(grid(one).goals) > 1),
    ]
    return [sheet for sheet in sheets if sheet is not None and sheet.rows]


def _groups(
    name: str, title: str, heading: str, members: Iterable[tuple[ConditionSummary, Sequence[Recount]]], *notes: str
) -> Sheet:
    return Sheet(
        name=name,
        title=title,
        columns=(Column("model", number=False), Column(heading, number=False), *_RATES),
        rows=tuple(_row(one, each) for one, groups in members for each in groups),
        notes=notes,
    )


def _row(one: ConditionSummary, each: Recount) -> Row:
    proportion, interval = each.proportion, each.interval
    return row(
        word(one.condition.name),
        word(each.what),
        of(proportion.successes, proportion.trials),
        percent(proportion.rate),
        interval_percent(interval.low, interval.high) if interval else Cell(UNKNOWN, -1),
    )


def _seeds(record: Record, results: Results) -> Sheet:
    groups = [(one, by_seed(record, one)) for one in results.conditions]
    spreads = [
        f"{one.condition.name}: the seeds' rates have a standard deviation of {100 * spread_between(mine):.1f} points."
        for one, mine in groups
        if len(mine) > 1
    ]
    return _groups("seeds", "Success by seed", "seed", groups, *spreads)


def drift_sheet(record: Record, results: Results) -> Sheet:
    """Over real sessions, and rehearsed ones, alone: a simulator by itself does not tire."""
    attended = set(record.episodes.loc[record.episodes["session"] > 0, "condition"])
    asked = [one for one in results.conditions if not one.condition.simulated or one.condition.number in attended]
    found = [(one, mine) for one in asked for whole in (False, True) if (mine := drift(record, one, whole=whole))]
    notes = [f"{one.condition.name}, over {mine.over}: {_drifted(mine)}" for one, mine in found]
    return _groups("drift", "Success over time", "part", ((one, mine.thirds) for one, mine in found), *notes)


def _drifted(mine: Drift) -> str:
    words = ""
    if mine.interval.known:
        low, high = 100 * mine.interval.low, 100 * mine.interval.high
        words = f"last third less first {100 * mine.difference:+.1f} points [{low:+.1f}, {high:+.1f}], "
    words += f"p {compared(mine.trend.p)}{'' if mine.trend.exact else ' (normal)'} of success and time"
    if mine.trend.least_p > 0.05:
        return f"{words}; with these few no order of them could have shown a drift."
    return f"{words} having nothing to do with each other, goal for goal."


def _grid(one: ConditionSummary) -> Sheet:
    cells = grid(one)
    return Sheet(
        name=f"grid-{one.condition.number}",
        title=f"{one.condition.name}: success by starting position and goal",
        columns=(Column("start"), *(Column(goal) for goal in cells.goals)),
        rows=tuple(
            row(
                count(start),
                *(
                    of(mine.successes, mine.trials) if (mine := cells.cells.get((goal, start))) else Cell(UNKNOWN, -1)
                    for goal in cells.goals
                ),
            )
            for start in cells.starts
        ),
        condition=one.condition.number,
    )


def failure_sheet(results: Results, failures: Sequence[Failures]) -> Sheet | None:
    """Why episodes failed; None where none did."""
    by_number = {one.condition.number: one for one in results.conditions}
    rows, notes = [], []
    for each in failures:
        one = by_number[each.condition]
        rows += [
            row(word(one.condition.name), word(kind.value), count(number), percent(number / each.examined, 1))
            for kind, number in each.looked_at
        ]
        if each.examined < each.failed:
            notes.append(f"{one.condition.name}: {each.examined} of {each.failed} failures, evenly picked.")
        if each.never_in_view is not None:
            notes.append(f"{one.condition.name}: the goal was never in view in {each.never_in_view} of these failures.")
        if each.touched:
            things = ", ".join(f"{harmless(thing)} {times}" for thing, times in each.touched)
            notes.append(f"{one.condition.name} collided with: {things}.")
    if not rows:
        return None
    return Sheet(
        name="failures",
        title="Why episodes failed",
        columns=(
            Column("model", number=False),
            Column("kind", number=False),
            Column("episodes"),
            Column("% of those looked at"),
        ),
        rows=tuple(rows),
        notes=(*notes, "From poses and the site's walls; furniture between robot and goal is not counted."),
    )


def judgement_sheet(results: Results, judgements: Sequence[Judgements]) -> Sheet | None:
    """How often people overruled the protocol; None where nobody judged."""
    by_number = {one.condition.number: one for one in results.conditions}
    rows, notes = [], []
    for each in judgements:
        one = by_number[each.condition]
        to_success = sum(change.after is True for change in each.overruled)
        to_failure = sum(change.after is False for change in each.overruled)
        rows.append(
            row(
                word(one.condition.name),
                count(each.judged),
                count(len(each.overruled)),
                percent(each.rate, 1),
                count(to_success),
                count(to_failure),
                count(len(each.overruled) - to_success - to_failure),
            )
        )
        for change in each.overruled[:_NAMED]:
            became = {True: "a success", False: "a failure", None: "void"}[change.after]
            notes.append(f"Episode {change.episode}: {became} by {harmless(change.author)}: {harmless(change.reason)}.")
        if len(each.overruled) > _NAMED:
            notes.append(f"And {len(each.overruled) - _NAMED} more under {one.condition.name}.")
    if not rows:
        return None
    return Sheet(
        name="judgements",
        title="Verdicts of the protocol that people judged",
        columns=(
            Column("model", number=False),
            Column("judged by a person"),
            Column("overruled"),
            Column("%"),
            Column("to success"),
            Column("to failure"),
            Column("to void"),
        ),
        rows=tuple(rows),
        notes=tuple(notes),
    )
