"""The question of a report as sheets: the models at once, and every pair of them."""

from collections.abc import Sequence
from dataclasses import replace

from vsnbench.report.comparison_tables import contest_sheet
from vsnbench.report.conditions import footnotes
from vsnbench.report.question import Question
from vsnbench.report.sheets import Column, Sheet, decimal, interval_percent, of, row, word
from vsnbench.report.verdicts import compared


def question_sheets(questions: Sequence[Question]) -> list[Sheet]:
    """Return, a question, all its models at once where they are three or more, and every pair."""
    sheets = []
    for number, question in enumerate(questions, start=1):
        if question.contest:
            whole = contest_sheet(question.contest)
            sheets.append(replace(whole, name=f"contest-{number}", title=f"{question.where}: {whole.title}"))
        if question.pairs:
            sheets.append(_pairs(question, number))
    return sheets


def _pairs(question: Question, number: int) -> Sheet:
    rows = []
    for comparison, rate in question.pairs:
        (mine, theirs), interval = rate.compared, rate.interval
        apart = "told apart" if rate.covered and rate.significant else "not told apart"
        rows.append(
            row(
                word(comparison.first.name),
                word(comparison.second.name),
                of(mine.successes, mine.trials),
                of(theirs.successes, theirs.trials),
                decimal(100 * rate.difference, 1),
                interval_percent(interval.low, interval.high, 1),
                replace(decimal(rate.adjusted_p, 3), text=compared(rate.adjusted_p).removeprefix("= ")),
                word(apart),
            )
        )
    left_out = f"Not asked: {'; '.join(question.not_asked)}." if question.not_asked else ""
    return Sheet(
        name=f"pairs-{number}",
        title=f"{question.where}: every pair, on the goals that both were asked for",
        columns=(
            Column("A", number=False),
            Column("B", number=False),
            Column("A k/n", rank=2),
            Column("B k/n", rank=2),
            Column("A - B", note="difference in success rate, points; paired: the mean over the cells"),
            Column("95 % interval", note="of the difference, points"),
            Column("p", note="after Holm's correction for every pair"),
            Column("finding", number=False),
        ),
        rows=tuple(rows),
        notes=(left_out,) if left_out else (),
        footnotes=footnotes([one.condition for one in question.members]),
    )
