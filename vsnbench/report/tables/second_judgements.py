"""Second judgements: agreement of raters with the verdicts, and the episodes that differ."""

from collections.abc import Mapping
from typing import Any

from vsnbench.report.analysis.activity import Rows
from vsnbench.report.measures import CELL, COUNT, TEXT, Measure, Measures, decimals, intervals, objects, percents
from vsnbench.report.table import ReportTable, TableCell
from vsnbench.results.second_judgements import Outcome


def _only_success(side: int) -> Measure:
    """Return the measure of the episodes that only one side judged as a success."""

    def number(rater: Mapping[str, Any]) -> int:
        return sum(
            times
            for outcomes, times in rater["outcomes"].items()
            if outcomes[side] is Outcome.SUCCESS and outcomes[1 - side] is not Outcome.SUCCESS
        )

    return Measure("", COUNT, of=number, heading=f"only {('first', 'second')[side]} success", rank=2 + side)


def _outcomes(rater: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [
        {"first": first, "second": second, "episodes": times}
        for (first, second), times in sorted(rater["outcomes"].items())
    ]


_OUTCOMES = Measures(
    Measure("first", TEXT, "outcome of the verdict"),
    Measure("second", TEXT, "outcome of the second rater"),
    Measure("episodes", COUNT, "number of episodes"),
)
DIFFERING = Measures(
    Measure(
        "", CELL, of=lambda row: TableCell(str(row["episode"]), row["episode"], (row["episode"],)), heading="episode"
    ),
    Measure("", TEXT, of="rater", heading="rater"),
    Measure("episode", COUNT, "number of the episode"),
    Measure("goal", TEXT, "goal of the episode", heading="goal", note="", rank=2),
    Measure("start", COUNT, "number of the starting position", heading="start", note="", rank=3),
    Measure("first", TEXT, "outcome of the verdict", heading="verdict", note=""),
    Measure("second", TEXT, "outcome of the second rater", heading="second", note=""),
    Measure("text", TEXT, "answer of the second rater in words", heading="rater's answer", note="", rank=1),
)
_TWICE = "episodes with a verdict and this rater's answer"
_SAME = "share of the episodes with the same outcome: success, failure or void"
_KAPPA, _OF_KAPPA = "Cohen's kappa: agreement beyond chance", "of kappa, from resampled starting positions"
RATERS = Measures(
    Measure("rater", TEXT, "name of the second rater", heading="rater", note=""),
    Measure("episodes", COUNT, _TWICE, lambda rater: rater["agreement"].items, heading="judged twice"),
    Measure("same", percents(1), _SAME, lambda rater: rater["agreement"].same, heading="agreement %"),
    Measure("kappa", decimals(2), _KAPPA, lambda rater: rater["agreement"].kappa, heading="kappa"),
    Measure(
        "ci",
        intervals(2, 1),
        "the 95 % interval of kappa",
        lambda rater: rater["agreement"].interval,
        heading="95 % interval",
        note=_OF_KAPPA,
        rank=1,
    ),
    _only_success(0),
    _only_success(1),
    Measure("outcomes", objects(_OUTCOMES), "one object per pair of outcomes", _outcomes),
    Measure("differing", objects(DIFFERING), "episodes with different outcomes"),
)


def second_judgement_tables(raters: Rows) -> list[ReportTable]:
    """Return the table of agreement and that of the episodes that differ; none without second judgements."""
    notes = ("Raters saw neither the verdict nor the model's name. Kappa: 1 is perfect, 0 is chance.",)
    differing = [row | {"rater": rater["rater"]} for rater in raters for row in rater["differing"]]
    tables = (
        RATERS.table("second-judgements", "Blind second judgements", raters, notes=notes),
        DIFFERING.table("differing-judgements", "Episodes judged differently", differing),
    )
    return [table for table in tables if table.rows]
