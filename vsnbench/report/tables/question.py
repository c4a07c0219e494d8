"""Tables of a report's questions: the ranking and all pairs."""

from collections.abc import Sequence
from dataclasses import replace

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.question import Question
from vsnbench.report.table import Column, ReportTable, decimal, interval_percent, of, p_cell, row
from vsnbench.report.tables.comparison import ranking_table


def question_tables(questions: Sequence[Question]) -> list[ReportTable]:
    """Return, for each question, the ranking of three or more models and the table of pairs."""
    tables = []
    for number, question in enumerate(questions, start=1):
        if question.ranking:
            overall = ranking_table(question.ranking)
            tables.append(replace(overall, name=f"ranking-{number}", title=f"{question.where}: {overall.title}"))
        if question.pairs:
            tables.append(_pairs(question, number))
    return tables


def _pairs(question: Question, number: int) -> ReportTable:
    rows = []
    for comparison, rate in question.pairs:
        mine, theirs = rate.compared
        finding = "different" if rate.conclusion.names_winner else "no difference shown"
        rows.append(
            row(
                comparison.first.name,
                comparison.second.name,
                of(mine.successes, mine.trials),
                of(theirs.successes, theirs.trials),
                decimal(100 * rate.difference, 1),
                interval_percent(rate.interval, 1),
                p_cell(rate.adjusted_p),
                finding,
            )
        )
    left_out = f"Not compared: {'; '.join(question.not_compared)}." if question.not_compared else ""
    return ReportTable(
        name=f"pairs-{number}",
        title=f"{question.where}: all pairs, on the shared goals",
        columns=(
            Column("A", number=False),
            Column("B", number=False),
            Column("A k/n", rank=2),
            Column("B k/n", rank=2),
            Column("A - B", note="difference in success rate, points; if paired, the mean over the cells"),
            Column("95 % interval", note="interval of the difference, points, simultaneous for all pairs"),
            Column("p", note="Holm-corrected for all pairs"),
            Column("finding", number=False),
        ),
        rows=tuple(rows),
        notes=(left_out,) if left_out else (),
        footnotes=footnotes([summary.condition for summary in question.members]),
    )
