"""What a comparison says on request: equivalence within a margin, and what to believe; and all of it in one place."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vsnbench.report.compare import ALL, Comparison, RateComparison
from vsnbench.report.comparison_tables import (
    comparison_fields,
    comparison_sheets,
    contest_fields,
    contest_sheet,
    finite,
)
from vsnbench.report.contest import Contest
from vsnbench.report.sheets import Column, Row, Sheet, interval_percent, percent, row, word
from vsnbench.statistics.clustered import effective_sample
from vsnbench.statistics.equivalence import Equivalence, independent_equivalence, paired_equivalence
from vsnbench.statistics.posterior import posterior, probability_better


@dataclass(frozen=True, slots=True)
class Asked:
    """What was asked for beside the one test."""

    all_tests: bool = False
    margin: float | None = None
    """The largest difference of rates that does not matter, as a share."""
    posterior: bool = False


def answer_sheets(comparisons: Sequence[Comparison], contest: Contest | None, asked: Asked) -> list[Sheet]:
    """Return everything that a comparison says, as sheets."""
    sheets = [contest_sheet(contest)] if contest else []
    sheets += [sheet for one in comparisons for sheet in comparison_sheets(one, all_tests=asked.all_tests)]
    if asked.margin is not None:
        sheets.append(_equivalence_sheet(comparisons, asked.margin))
    if asked.posterior:
        sheets.append(_posterior_sheet(comparisons))
    return sheets


def answer_fields(comparisons: Sequence[Comparison], contest: Contest | None, asked: Asked) -> dict[str, Any]:
    """Return the same as JSON values."""
    listed = []
    for one in comparisons:
        fields = comparison_fields(one)
        for rate, its in zip(one.rates, fields["rates"], strict=True):
            if asked.margin is not None and (found := equivalence(rate, asked.margin)):
                its["equivalence"] = {
                    "margin": found.margin,
                    "ci90_low": finite(found.interval.low),
                    "ci90_high": finite(found.interval.high),
                    "equivalent": found.shown,
                    "differ_by_more": found.excluded,
                }
            if asked.posterior and (better := chance_better(rate)) is not None:
                its["probability_first_better"] = better
        listed.append(fields)
    return {"contest": contest_fields(contest) if contest else None, "comparisons": listed}


def equivalence(rate: RateComparison, margin: float) -> Equivalence | None:
    """Return whether two rates are equivalent; None where there is nothing to compare, or goals differ."""
    if rate.scope == ALL or not rate.first.episodes or not rate.second.episodes:
        return None
    if rate.pairing:
        return paired_equivalence(rate.pairing.outcomes, margin)
    return independent_equivalence(rate.first.outcomes, rate.second.outcomes, margin)


def chance_better(rate: RateComparison) -> float | None:
    """Return the probability that the first model is the better, 0 to 1; None where there is nothing to compare."""
    if rate.scope == ALL or not rate.first.episodes or not rate.second.episodes:
        return None
    if rate.pairing:
        both = rate.pairing.outcomes
        samples = [effective_sample(each, by_cell=True) for each in (both.first, both.second)]
    else:
        samples = [effective_sample(each.outcomes) for each in (rate.first, rate.second)]
    return probability_better(posterior(samples[0]), posterior(samples[1]))


def _equivalence_sheet(comparisons: Sequence[Comparison], margin: float) -> Sheet:
    rows: list[Row] = []
    for one in comparisons:
        for rate in one.rates:
            if found := equivalence(rate, margin):
                said = "equivalent" if found.shown else "further apart" if found.excluded else "not shown"
                rows.append(
                    row(
                        word(one.first.name),
                        word(one.second.name),
                        word(rate.scope),
                        percent(rate.difference),
                        interval_percent(found.interval.low, found.interval.high),
                        word(said),
                    )
                )
    return Sheet(
        name="equivalence",
        title=f"Equivalence within {100 * margin:g} points",
        columns=(
            Column("A", number=False),
            Column("B", number=False),
            Column("on", number=False),
            Column("A - B"),
            Column("90 % interval"),
            Column("within the margin", number=False),
        ),
        rows=tuple(rows),
        notes=("Two one-sided tests at 5 %, not corrected: equivalent where the 90 % interval lies within.",),
    )


def _posterior_sheet(comparisons: Sequence[Comparison]) -> Sheet:
    rows = [
        row(word(one.first.name), word(one.second.name), word(rate.scope), percent(better, 1), percent(1 - better, 1))
        for one in comparisons
        for rate in one.rates
        if (better := chance_better(rate)) is not None
    ]
    return Sheet(
        name="posterior",
        title="What to believe: the probability of being the better",
        columns=(
            Column("A", number=False),
            Column("B", number=False),
            Column("on", number=False),
            Column("A better %"),
            Column("B better %"),
        ),
        rows=tuple(rows),
        notes=(
            "Jeffreys' prior, outcomes at their effective sample size, the two rates taken for independent.",
            "A probability, not a p-value.",
        ),
    )
