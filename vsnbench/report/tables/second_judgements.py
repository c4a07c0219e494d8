"""Second judgements as tables and JSON values."""

from collections.abc import Sequence
from typing import Any

from vsnbench.report.analysis.fields import finite, interval_fields
from vsnbench.report.analysis.judgements import RaterAgreement
from vsnbench.report.table import Cell, Column, ReportTable, decimal, interval_cell, percent, row
from vsnbench.results.second_judgements import Outcome


def second_judgement_tables(raters: Sequence[RaterAgreement]) -> list[ReportTable]:
    """Return the table of agreement and that of the episodes that differ; none without second judgements."""
    tables = []
    if raters:
        tables.append(_agreement_table(raters))
    if any(rater.differing for rater in raters):
        tables.append(_differing_table(raters))
    return tables


def _agreement_table(raters: Sequence[RaterAgreement]) -> ReportTable:
    rows = []
    for rater in raters:
        found = rater.agreement
        only_first, only_second = (
            sum(
                number
                for outcomes, number in rater.outcomes.items()
                if outcomes[side] is Outcome.SUCCESS and outcomes[1 - side] is not Outcome.SUCCESS
            )
            for side in (0, 1)
        )
        rows.append(
            row(
                rater.rater,
                found.items,
                percent(found.same, 1),
                decimal(found.kappa, 2),
                interval_cell(found.interval, 2),
                only_first,
                only_second,
            )
        )
    return ReportTable(
        name="second-judgements",
        title="Blind second judgements",
        columns=(
            Column("rater", number=False),
            Column("judged twice", note="episodes with a verdict and this rater's answer"),
            Column("agreement %", note="share of the episodes with the same outcome: success, failure or void"),
            Column("kappa", note="Cohen's kappa: agreement beyond chance"),
            Column("95 % interval", rank=1, note="of kappa, from resampled starting positions"),
            Column("only first success", rank=2),
            Column("only second success", rank=3),
        ),
        rows=tuple(rows),
        notes=("Raters saw neither the verdict nor the model's name. Kappa: 1 is perfect, 0 is chance.",),
    )


def _differing_table(raters: Sequence[RaterAgreement]) -> ReportTable:
    return ReportTable(
        name="differing-judgements",
        title="Episodes judged differently",
        columns=(
            Column("episode"),
            Column("rater", number=False),
            Column("goal", number=False, rank=2),
            Column("start", rank=3),
            Column("verdict", number=False),
            Column("second", number=False),
            Column("rater's answer", number=False, rank=1),
        ),
        rows=tuple(
            row(
                Cell(str(differing.episode), differing.episode, links=(differing.episode,)),
                rater.rater,
                differing.goal,
                differing.start,
                differing.first,
                differing.second,
                differing.text,
            )
            for rater in raters
            for differing in rater.differing
        ),
    )


def second_judgement_fields(raters: Sequence[RaterAgreement]) -> list[dict[str, Any]]:
    """Return the second judgements as JSON values."""
    return [
        {
            "rater": rater.rater,
            "episodes": rater.agreement.items,
            "same": finite(rater.agreement.same),
            "kappa": finite(rater.agreement.kappa),
            **interval_fields(rater.agreement.interval),
            "outcomes": [
                {"first": first.value, "second": second.value, "episodes": number}
                for (first, second), number in sorted(rater.outcomes.items())
            ],
            "differing": [
                {
                    "episode": differing.episode,
                    "goal": differing.goal,
                    "start": differing.start,
                    "first": differing.first.value,
                    "second": differing.second.value,
                    "text": differing.text,
                }
                for differing in rater.differing
            ],
        }
        for rater in raters
    ]
