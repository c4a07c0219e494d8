"""The paper's Tables 3 to 6 as sheets, from data and with the intervals it leaves out; and ours laid beside them."""

from vsnbench.report.compare import Comparison, compare, over_goals
from vsnbench.report.comparison_tables import comparison_sheets
from vsnbench.report.conditions import footnotes
from vsnbench.report.published import published, published_results
from vsnbench.report.record import empty_record, goal_order
from vsnbench.report.sheets import (
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
from vsnbench.report.summary import ConditionSummary, GoalSummary, Results, Summary
from vsnbench.report.tables import goal_sheet
from vsnbench.statistics.clustered import independent_difference


def reference_sheets() -> list[Sheet]:
    """Return the paper's Tables 3 to 6, what Figure 9 says in words, and the comparison that the paper leaves out."""
    paper, results = published(), published_results()
    sheets = [_real_against_virtual(results)]
    for model, one in zip(paper.models, results.conditions, strict=True):
        sheet = kept(goal_sheet(one))
        notes = [f"Source: {paper.source}, Table {model.table}; the intervals are Wilson's and ours."]
        if model.never_succeeding_starts:
            notes.append(
                f"Never a success from positions {listed(model.never_succeeding_starts)}, "
                f"a single one from {listed(model.once_succeeding_starts)}."
            )
        if model.stops:
            notes.append(
                f"STOP was sampled {model.stops.count} times, printed as {model.stops.percent} % of the actions "
                "(Figure 9); the two do not fit each other and are quoted as printed."
            )
        name, title = f"paper-table-{model.table}", f"Paper, Table {model.table}: {model.title}"
        sheets.append(Sheet(name, title, sheet.columns, sheet.rows, tuple(notes)))
    sheets.append(paper_stability_sheet())
    for comparison in reference_comparison():
        sheets += comparison_sheets(comparison)
    return sheets


def reference_comparison() -> tuple[Comparison, ...]:
    """Compare the paper's two models with each other."""
    results = published_results()
    return compare(empty_record(), results, ["paper:vlv", "paper:pirlnav"], published=results)


def beside_sheet(results: Results) -> Sheet:
    """Lay our success rates by goal beside the paper's; the difference where the model is one of the paper's."""
    paper = published_results()
    everyone = [*results.conditions, *paper.conditions]
    goals = list(dict.fromkeys(goal.goal for one in everyone for goal in one.goals))
    rows = [
        _beside(goal, one, summary, paper)
        for goal in goals
        for one in everyone
        for summary in one.goals
        if summary.goal == goal
    ]
    rows += [_beside("all", one, GoalSummary("all", one.total), paper) for one in everyone]
    rows += _on_shared_goals(results, paper)
    return kept(
        Sheet(
            name="beside-paper",
            title="Success by goal beside the paper's",
            columns=(
                Column("goal", number=False),
                Column("model", number=False),
                Column("where", number=False),
                Column("k/n"),
                Column("SR %"),
                Column("95 % interval"),
                Column("actions"),
                Column("less the paper's", note="difference in success rate from the same model in the paper, points"),
                Column("95 % interval", note="Newcombe's interval of that difference, points"),
            ),
            rows=tuple(rows),
            notes=(f"Published: {published().source}.",),
            footnotes=footnotes([one.condition for one in results.conditions]),
        )
    )


def _beside(goal: str, one: ConditionSummary, summary: GoalSummary, paper: Results) -> Row:
    mine = summary.summary
    theirs = None
    if not one.condition.published and (other := _of_paper(one, paper)):
        theirs = next((each.summary for each in other.goals if each.goal == goal), None)
        if goal == "all" and _goals(one) == _goals(other):  # else the goals differ, and not only the models
            theirs = other.total
    return _row(goal, one, mine, theirs, total=goal == "all")


def _row(goal: str, one: ConditionSummary, mine: Summary, theirs: Summary | None, *, total: bool) -> Row:
    unknown = decimal(float("nan"), 0)
    difference: tuple[Cell, Cell] = (unknown, unknown)
    if theirs and mine.episodes:
        interval = independent_difference(mine.outcomes, theirs.outcomes)
        difference = (
            decimal(100 * (mine.success_rate - theirs.success_rate), 2),
            interval_percent(interval.low, interval.high),
        )
    actions = float("nan") if goal.startswith("shared: ") else mine.mean_actions
    return row(
        word(goal),
        word(one.condition.name),
        word(f"{one.condition.environment}, {one.condition.site}"),
        of(mine.successes, mine.episodes),
        percent(mine.success_rate),
        interval_percent(mine.interval.low, mine.interval.high),
        decimal(actions, 1),
        *difference,
        total=total,
    )


def _on_shared_goals(results: Results, paper: Results) -> list[Row]:
    """Sum both up over the goals that they share, where these are not all goals of both."""
    rows = []
    for one in results.conditions:
        other = _of_paper(one, paper)
        shared = [goal for goal in _goals(other) if goal in _goals(one)] if other else []
        if other is None or not shared or _goals(one) == _goals(other):
            continue
        mine, theirs = over_goals(one, shared), over_goals(other, shared)
        name = f"shared: {listed(shared)}"
        rows += [_row(name, one, mine, theirs, total=True), _row(name, other, theirs, None, total=True)]
    return rows


def _of_paper(one: ConditionSummary, paper: Results) -> ConditionSummary | None:
    return next((each for each in paper.conditions if each.condition.model == one.condition.model.lower()), None)


def _goals(one: ConditionSummary) -> list[str]:
    return sorted((goal.goal for goal in one.goals), key=goal_order)


def _real_against_virtual(results: Results) -> Sheet:
    return Sheet(
        name="paper-table-3",
        title="Paper, Table 3: real world against simulation",
        columns=(
            Column("model", number=False),
            Column("real k/n"),
            Column("real SR %"),
            Column("95 % interval"),
            Column("virtual SR %"),
        ),
        rows=tuple(
            row(
                word(one.condition.name),
                of(one.total.successes, one.total.episodes),
                percent(one.total.success_rate),
                interval_percent(one.total.interval.low, one.total.interval.high),
                decimal(model.virtual_success_percent, 0),
            )
            for model, one in zip(published().models, results.conditions, strict=True)
        ),
        notes=("The virtual rates are those of the models' own papers; over how many episodes is not said.",),
    )


def paper_stability_sheet() -> Sheet:
    """How long and how far the paper's robots drove (paper, Table 6)."""
    paper = published()
    rows = [row(word(one.robot), count(round(one.hours)), decimal(one.kilometres, 2)) for one in paper.stability]
    rows.append(row(word("all"), count(round(paper.hours)), decimal(paper.kilometres, 2), total=True))
    return Sheet(
        name="paper-table-6",
        title="Paper, Table 6: stability",
        columns=(Column("robot", number=False), Column("hours"), Column("km")),
        rows=tuple(rows),
    )
