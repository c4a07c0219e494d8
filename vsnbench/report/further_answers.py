"""What a comparison says on request: equivalence within a margin, and what to believe; and all of it in one place."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from vsnbench.harmless_text import harmless
from vsnbench.report.compare import ALL, Comparison, RateComparison
from vsnbench.report.comparison_tables import (
    comparison_fields,
    comparison_sheets,
    contest_fields,
    contest_sheet,
    finite,
    p_cell,
)
from vsnbench.report.contest import Contest
from vsnbench.report.sheets import UNKNOWN, Column, Sheet, interval_percent, percent, row, word
from vsnbench.statistics.clustered import effective_sample
from vsnbench.statistics.equivalence import Equivalence, independent_equivalence, paired_equivalence
from vsnbench.statistics.posterior import posterior, probability_better
from vsnbench.statistics.rates import CONFIDENCE


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
                answer = equivalence_answer(rate, found)
                its["equivalence"] = {
                    "margin": found.margin,
                    "ci90_low": finite(found.interval.low),
                    "ci90_high": finite(found.interval.high),
                    "equivalent": answer is EquivalenceAnswer.EQUIVALENT,
                    "differ_by_more": answer is EquivalenceAnswer.FURTHER_APART,
                    "too_few": answer is EquivalenceAnswer.TOO_FEW,
                }
            if asked.posterior:
                its["probability_first_better"] = chance_better(rate)
        listed.append(fields)
    return {"contest": contest_fields(contest) if contest else None, "comparisons": listed}


def equivalence(rate: RateComparison, margin: float) -> Equivalence | None:
    """Return whether two rates are equivalent; None where there is nothing to compare, or goals differ."""
    if rate.scope == ALL or not rate.first.episodes or not rate.second.episodes:
        return None
    if rate.pairing:
        return paired_equivalence(rate.pairing.outcomes, margin)
    return independent_equivalence(rate.first.outcomes, rate.second.outcomes, margin)


class EquivalenceAnswer(StrEnum):
    """What can be concluded of a margin."""

    EQUIVALENT = "equivalent"
    FURTHER_APART = "further apart"
    NOT_SHOWN = "not shown"
    TOO_FEW = "too few to say"


def equivalence_answer(rate: RateComparison, found: Equivalence) -> EquivalenceAnswer:
    """Return what can be concluded: nothing from a design that no outcome could give a small p-value.

    An interval of few trials may lie beyond the margin where the test, which is exact, does not tell the rates apart:
    further apart they are called only where it does.
    """
    if rate.reach.too_few(_LEVEL):
        return EquivalenceAnswer.TOO_FEW
    if found.shown:
        return EquivalenceAnswer.EQUIVALENT
    return EquivalenceAnswer.FURTHER_APART if found.excluded and rate.p < _LEVEL else EquivalenceAnswer.NOT_SHOWN


_LEVEL = 1 - CONFIDENCE


def chance_better(rate: RateComparison) -> float | None:
    """Return the probability that the first model is the better, 0 to 1; None where there is nothing to go by.

    Of few trials it is the prior's more than theirs: none is given where no outcome could give a small p-value.
    """
    if rate.scope == ALL or not rate.first.episodes or not rate.second.episodes or rate.reach.too_few(_LEVEL):
        return None
    if rate.pairing:
        both = rate.pairing.outcomes
        samples = [effective_sample(each, by_cell=True) for each in (both.first, both.second)]
    else:
        samples = [effective_sample(each.outcomes) for each in (rate.first, rate.second)]
    return probability_better(posterior(samples[0]), posterior(samples[1]))


def _equivalence_sheet(comparisons: Sequence[Comparison], margin: float) -> Sheet:
    rows = [
        row(
            word(one.first.name),
            word(one.second.name),
            word(rate.scope),
            percent(rate.difference),
            interval_percent(found.interval.low, found.interval.high),
            word(equivalence_answer(rate, found).value),
        )
        for one in comparisons
        for rate in one.rates
        if (found := equivalence(rate, margin))
    ]
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
        notes=(
            (
                "Two one-sided tests at 5 %, not corrected: equivalent where the 90 % interval lies within; further "
                "apart where it lies beyond and the test of the table above tells the rates apart."
            ),
            *_shortages(comparisons),
        ),
    )


def _shortages(comparisons: Sequence[Comparison]) -> tuple[str, ...]:
    """Say of which pairs nothing can be concluded, and why."""
    return tuple(
        f"{harmless(one.first.name)} and {harmless(one.second.name)}, {harmless(rate.scope)}: "
        f"{rate.reach.shortage(_LEVEL)}."
        for one in comparisons
        for rate in one.rates
        if rate.scope != ALL and rate.reach.too_few(_LEVEL)
    )


def _posterior_sheet(comparisons: Sequence[Comparison]) -> Sheet:
    rows = []
    for one in comparisons:
        for rate in one.rates:
            if rate.scope == ALL:
                continue
            better = chance_better(rate)
            believed = (UNKNOWN, UNKNOWN) if better is None else (_belief(better), _belief(1 - better))
            rows.append(
                row(word(one.first.name), word(one.second.name), word(rate.scope), *map(word, believed), p_cell(rate.p))
            )
    return Sheet(
        name="posterior",
        title="What to believe: the probability of being the better",
        columns=(
            Column("A", number=False),
            Column("B", number=False),
            Column("on", number=False),
            Column("A better %"),
            Column("B better %"),
            Column("p of the test", note="of no difference, not corrected"),
        ),
        rows=tuple(rows),
        notes=(
            "Jeffreys' prior, outcomes at their effective sample size, the two rates taken for independent.",
            (
                "A probability under that prior, no verdict: where the test does not tell two models apart, neither is "
                "shown to be the better."
            ),
            *_shortages(comparisons),
        ),
    )


def _belief(probability: float) -> str:
    """Return a probability in percent; never a certainty."""
    return "> 99.9" if probability > 0.999 else "< 0.1" if probability < 0.001 else f"{100 * probability:.1f}"
