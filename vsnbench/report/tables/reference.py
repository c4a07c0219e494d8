"""The paper's Tables 3 to 6 with intervals, and recorded results next to them."""

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.episodes_frame import empty_report_data, goal_order
from vsnbench.report.analysis.published import PAPER_INTERVALS, published, published_results
from vsnbench.report.analysis.summary import ConditionSummary, Group, ReportResults
from vsnbench.report.comparison.compare import Comparison, compare
from vsnbench.report.table import (
    EMPTY,
    Column,
    ReportTable,
    Row,
    decimal,
    interval_percent,
    rate_cells,
    row,
    without_empty_columns,
)
from vsnbench.report.tables.comparison import comparison_tables
from vsnbench.report.tables.success import SUMMARY, goal_table
from vsnbench.report.wording import listed
from vsnbench.statistics.clustered import independent_difference


def reference_tables() -> list[ReportTable]:
    """Return the paper's Tables 3 to 6, the text of Figure 9 and a comparison of the paper's models."""
    paper, results = published(), published_results()
    tables = [_real_against_virtual(results)]
    for model, summary in zip(paper.models, results.conditions, strict=True):
        table = without_empty_columns(goal_table(summary))
        notes = [f"Source: {paper.source}, Table {model.table}, which has no intervals. {PAPER_INTERVALS}"]
        if model.never_succeeding_starts:
            notes.append(
                f"No success from positions {listed(model.never_succeeding_starts)}, "
                f"one success from {listed(model.once_succeeding_starts)}."
            )
        if model.stops:
            notes.append(
                f"STOP was sampled {model.stops.count} times, printed as {model.stops.percent} % of the actions "
                "(Figure 9); the two values are inconsistent and quoted as printed."
            )
        name, title = f"paper-table-{model.table}", f"Paper, Table {model.table}: {model.title}"
        tables.append(ReportTable(name, title, table.columns, table.rows, tuple(notes)))
    tables.append(paper_stability_table())
    for comparison in reference_comparison():
        tables += comparison_tables(comparison)
    return tables


def reference_comparison() -> tuple[Comparison, ...]:
    """Compare the paper's two models."""
    results = published_results()
    return compare(empty_report_data(), results, ["paper:vlv", "paper:pirlnav"], published=results)


def paper_comparison_table(results: ReportResults) -> ReportTable:
    """Return success rates by goal next to the paper's, with the difference for the paper's models."""
    paper = published_results()
    everyone = [*results.conditions, *paper.conditions]
    goals = list(dict.fromkeys(goal for condition_summary in everyone for goal in condition_summary.own_goals))
    rows = [
        _goal_row(goal, condition_summary, group, paper)
        for goal in goals
        for condition_summary in everyone
        for group in condition_summary.goals
        if group.goal == goal
    ]
    rows += [_goal_row("all", condition_summary, condition_summary.total, paper) for condition_summary in everyone]
    rows += _on_shared_goals(results, paper)
    return without_empty_columns(
        ReportTable(
            name="paper-comparison",
            title="Success by goal, with the paper's results",
            columns=(
                Column("goal", number=False),
                Column("model", number=False),
                Column("where", number=False),
                Column("k/n"),
                Column("SR %"),
                Column("95 % interval"),
                Column("actions"),
                Column("minus paper", note="difference in success rate from the same model in the paper, points"),
                Column("95 % interval", note="Newcombe's interval of that difference, points"),
            ),
            rows=tuple(rows),
            notes=(f"Published: {published().source}.", PAPER_INTERVALS),
            footnotes=footnotes([summary.condition for summary in results.conditions]),
        )
    )


def _goal_row(goal: str, condition_summary: ConditionSummary, mine: Group, paper: ReportResults) -> Row:
    theirs = None
    if not condition_summary.condition.published and (other := _of_paper(condition_summary, paper)):
        theirs = next((group for group in other.goals if group.goal == goal), None)
        if goal == "all" and _goals(condition_summary) == _goals(other):
            theirs = other.total
    return _row(goal, condition_summary, mine, theirs, total=goal == "all")


def _row(goal: str, condition_summary: ConditionSummary, mine: Group, theirs: Group | None, *, total: bool) -> Row:
    difference = (EMPTY, EMPTY)
    if theirs and mine.episodes:
        interval = independent_difference(mine.outcomes, theirs.outcomes)
        difference = (
            decimal(100 * (mine.success_rate - theirs.success_rate), 2),
            interval_percent(interval),
        )
    actions = float("nan") if goal.startswith("shared: ") else SUMMARY.named("mean_actions").value(mine)
    return row(
        goal,
        condition_summary.condition.name,
        f"{condition_summary.condition.environment}, {condition_summary.condition.site}",
        *rate_cells(mine.proportion, mine.interval),
        decimal(actions, 1),
        *difference,
        total=total,
    )


def _on_shared_goals(results: ReportResults, paper: ReportResults) -> list[Row]:
    """Return the sums over the shared goals, if a model and its published result have different goals."""
    rows = []
    for summary in results.conditions:
        other = _of_paper(summary, paper)
        shared = [goal for goal in _goals(other) if goal in _goals(summary)] if other else []
        if other is None or not shared or _goals(summary) == _goals(other):
            continue
        mine, theirs = summary.over(shared), other.over(shared)
        name = f"shared: {listed(shared)}"
        rows += [_row(name, summary, mine, theirs, total=True), _row(name, other, theirs, None, total=True)]
    return rows


def _of_paper(summary: ConditionSummary, paper: ReportResults) -> ConditionSummary | None:
    model = summary.condition.model.lower()
    return next((other for other in paper.conditions if other.condition.model == model), None)


def _goals(summary: ConditionSummary) -> list[str]:
    return sorted(summary.own_goals, key=goal_order)


def _real_against_virtual(results: ReportResults) -> ReportTable:
    return ReportTable(
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
                summary.condition.name,
                *rate_cells(summary.total.proportion, summary.total.interval),
                decimal(model.virtual_success_percent, 0),
            )
            for model, summary in zip(published().models, results.conditions, strict=True)
        ),
        notes=(
            PAPER_INTERVALS,
            "The virtual rates are those of the models' own papers, which do not state the number of episodes.",
        ),
    )


def paper_stability_table() -> ReportTable:
    """Return the driving time and distance of the paper's robots (paper, Table 6)."""
    paper = published()
    rows = [row(robot.robot, round(robot.hours), decimal(robot.kilometres, 2)) for robot in paper.stability]
    rows.append(row("all", round(paper.hours), decimal(paper.kilometres, 2), total=True))
    return ReportTable(
        name="paper-table-6",
        title="Paper, Table 6: stability",
        columns=(Column("robot", number=False), Column("hours"), Column("km")),
        rows=tuple(rows),
    )
