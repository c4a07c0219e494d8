"""A comparison as sheets, and as JSON values."""

import math
from typing import Any

from vsnbench.report.compare import ALL, SHARED, Comparison, RateComparison
from vsnbench.report.conditions import footnotes
from vsnbench.report.forms.plain import condition_fields
from vsnbench.report.sheets import (
    UNKNOWN,
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


def comparison_sheets(comparison: Comparison) -> list[Sheet]:
    """Return the rates with their tests, and the effects on actions and SPL."""
    a, b = comparison.first.name, comparison.second.name
    name = f"{comparison.first.number}-{comparison.second.number}"
    rates = Sheet(
        name=f"compare-{name}",
        title=f"A: {a} against B: {b}",
        columns=(
            Column("on", number=False),
            Column("A k/n"),
            Column("A SR %"),
            Column("B k/n"),
            Column("B SR %"),
            Column("A - B"),
            Column("95 % interval", note="Newcombe's interval of the difference, points"),
            Column("Fisher p", rank=1),
            Column("Barnard p", rank=3),
            Column("pairs", rank=3),
            Column("only A : only B", rank=4, note="pairs in which only one of them succeeded"),
            Column("McNemar p", rank=1),
            Column("by start p", rank=2, note="exact permutation of the models within each starting position"),
            Column("Holm p", rank=2),
        ),
        rows=tuple(_rate_row(rate, comparison.asked) for rate in comparison.rates),
        notes=(*comparison.verdicts, *footnotes([comparison.first, comparison.second])),
    )
    if not comparison.effects:
        return [kept(rates)]
    effects = Sheet(
        name=f"effects-{name}",
        title="Actions and path efficiency on the shared goals",
        columns=(
            Column("measure", number=False),
            Column("A"),
            Column("B"),
            Column("A - B"),
            Column("95 % interval", note="bootstrap of whole starting positions"),
        ),
        rows=tuple(
            row(
                word(effect.measure),
                decimal(effect.first, _places(effect.measure)),
                decimal(effect.second, _places(effect.measure)),
                decimal(effect.difference, _places(effect.measure)),
                _plain_interval(effect.interval.low, effect.interval.high, _places(effect.measure)),
            )
            for effect in comparison.effects
        ),
        notes=(
            "Intervals by resampling starting positions as a whole: episodes from one position resemble each other.",
        ),
    )
    return [kept(rates), effects]


def comparison_fields(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON values; None for what is unknown."""
    return {
        "first": condition_fields(comparison.first),
        "second": condition_fields(comparison.second),
        "questions": comparison.asked,
        "rates": [_rate_fields(rate) for rate in comparison.rates],
        "effects": [
            {
                "measure": effect.measure,
                "first": _finite(effect.first),
                "second": _finite(effect.second),
                "difference": _finite(effect.difference),
                "ci_low": _finite(effect.interval.low),
                "ci_high": _finite(effect.interval.high),
            }
            for effect in comparison.effects
        ],
        "verdicts": list(comparison.verdicts),
    }


def _rate_row(rate: RateComparison, asked: int) -> Row:
    scope = f"shared: {listed(rate.goals[0])}" if rate.scope == SHARED else rate.scope
    paired = rate.paired
    unknown = Cell(UNKNOWN, -math.inf)
    return row(
        word(scope),
        of(rate.first.successes, rate.first.episodes),
        percent(rate.first.success_rate),
        of(rate.second.successes, rate.second.episodes),
        percent(rate.second.success_rate),
        decimal(100 * rate.difference, 2),
        interval_percent(rate.interval.low, rate.interval.high),
        _p(rate.fisher_p),
        _p(rate.barnard_p),
        count(paired.pairs) if paired else unknown,
        Cell(f"{paired.only_first} : {paired.only_second}", paired.only_first) if paired else unknown,
        _p(paired.mcnemar_p) if paired else unknown,
        _p(paired.permutation_p) if paired else unknown,
        _p(rate.adjusted_p) if asked > 1 and rate.scope != ALL else unknown,
    )


def _rate_fields(rate: RateComparison) -> dict[str, Any]:
    paired = rate.paired
    return {
        "scope": rate.scope,
        "goals_first": list(rate.goals[0]),
        "goals_second": list(rate.goals[1]),
        "successes_first": rate.first.successes,
        "episodes_first": rate.first.episodes,
        "planned_first": rate.first.planned,
        "successes_second": rate.second.successes,
        "episodes_second": rate.second.episodes,
        "planned_second": rate.second.planned,
        "difference": _finite(rate.difference),
        "ci_low": _finite(rate.interval.low),
        "ci_high": _finite(rate.interval.high),
        "fisher_p": _finite(rate.fisher_p),
        "barnard_p": _finite(rate.barnard_p),
        "pairs": paired.pairs if paired else None,
        "only_first": paired.only_first if paired else None,
        "only_second": paired.only_second if paired else None,
        "mcnemar_p": _finite(paired.mcnemar_p) if paired else None,
        "permutation_p": _finite(paired.permutation_p) if paired else None,
        "p": _finite(rate.p),
        "adjusted_p": _finite(rate.adjusted_p),
        "covered": rate.covered,
        "significant": rate.covered and rate.significant,
        "more_trials": rate.more_trials,
    }


def _p(value: float) -> Cell:
    if math.isfinite(value) and value < 0.001:
        return Cell("< 0.001", value)
    return decimal(value, 3)


def _places(measure: str) -> int:
    return 1 if measure.startswith("actions") else 3


def _plain_interval(low: float, high: float, places: int) -> Cell:
    if not (math.isfinite(low) and math.isfinite(high)):
        return Cell(UNKNOWN, -math.inf)
    return Cell(f"[{low:.{places}f}, {high:.{places}f}]", low)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
