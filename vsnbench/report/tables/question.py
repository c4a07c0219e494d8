"""A report's questions: the ranking and all pairs."""

from collections.abc import Sequence
from dataclasses import replace

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.compare import Comparison, RateComparison
from vsnbench.report.comparison.question import ModelQuestion
from vsnbench.report.measures import RATIO, TEXT, TEXTS, Measure, Measures, P, an_object, decimals, intervals, objects
from vsnbench.report.table import ReportTable
from vsnbench.report.tables.comparison import COMPARISON
from vsnbench.report.tables.ranking import RANKING, ranking_table

Pair = tuple[Comparison, RateComparison]


def question_tables(questions: Sequence[ModelQuestion]) -> list[ReportTable]:
    """Return, for each question, the ranking of three or more models and the table of pairs."""
    tables = []
    for number, question in enumerate(questions, start=1):
        if question.ranking:
            overall = ranking_table(question.ranking)
            tables.append(replace(overall, name=f"ranking-{number}", title=f"{question.where}: {overall.title}"))
        if question.pairs:
            tables.append(_pairs(question, number))
    return tables


def _side(side: int) -> tuple[Measure, Measure]:
    """Return the measures of the first or the second condition of a pair."""
    letter, name = "AB"[side], ("first", "second")[side]

    def of(pair: Pair) -> tuple[int, int]:
        compared = pair[1].compared[side]
        return compared.successes, compared.trials

    return (
        Measure("", TEXT, of=lambda pair: getattr(pair[0], name).name, heading=letter),
        Measure("", RATIO, of=of, heading=f"{letter} k/n", rank=2),
    )


def _finding(pair: Pair) -> str:
    return "different" if pair[1].conclusion.names_winner else "no difference shown"


_DIFFERENCE = "difference in success rate, points; if paired, the mean over the cells"
_INTERVAL = "interval of the difference, points, simultaneous for all pairs"
_A, _B = _side(0), _side(1)
_PAIR = Measures(
    *(_A[0], _B[0], _A[1], _B[1]),
    Measure("", decimals(1, 100), _DIFFERENCE, lambda pair: pair[1].difference, heading="A - B"),
    Measure("", intervals(1), _INTERVAL, lambda pair: pair[1].interval, heading="95 % interval"),
    Measure("", P, "Holm-corrected for all pairs", lambda pair: pair[1].adjusted_p, heading="p"),
    Measure("", TEXT, of=_finding, heading="finding"),
)
QUESTION = Measures(
    Measure("where", TEXT, "robot and site of the compared conditions"),
    Measure(
        "members",
        TEXTS,
        "names of the compared conditions",
        lambda question: [member.condition.name for member in question.members],
    ),
    Measure("answers", TEXTS, "conclusions, one sentence each"),
    Measure("not_compared", TEXTS, "conditions left out, with the reasons"),
    Measure("ranking", an_object(RANKING), "all models at once", null="with fewer than three, or without shared goals"),
    Measure("comparisons", objects(COMPARISON), "one object per pair of conditions"),
)
"""The JSON object of a question."""


def _pairs(question: ModelQuestion, number: int) -> ReportTable:
    left_out = f"Not compared: {'; '.join(question.not_compared)}." if question.not_compared else ""
    return _PAIR.table(
        f"pairs-{number}",
        f"{question.where}: all pairs, on the shared goals",
        question.pairs,
        notes=(left_out,) if left_out else (),
        footnotes=footnotes([summary.condition for summary in question.members]),
    )
