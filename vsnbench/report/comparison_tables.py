"""A comparison as sheets, and as JSON values."""

import math
from typing import Any

from vsnbench.report.compare import ALL, SHARED, Comparison, OtherTests, RateComparison
from vsnbench.report.conditions import footnotes
from vsnbench.report.contest import Contest
from vsnbench.report.forms.plain import condition_fields
from vsnbench.report.outlook import Outlook
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
from vsnbench.report.verdicts import compared, verdicts
from vsnbench.statistics.bootstrap import FEWEST_CLUSTERS


def comparison_sheets(comparison: Comparison, *, all_tests: bool = False) -> list[Sheet]:
    """Return the rates with their test, and the effects on actions and SPL.

    Args:
        comparison: of two conditions.
        all_tests: show the tests that are not read as well.
    """
    a, b = comparison.first.name, comparison.second.name
    name = f"{comparison.first.number}-{comparison.second.number}"
    others = (
        Column("Fisher p", rank=3, note="as if every episode were independent"),
        Column("Barnard p", rank=3, note="as if every episode were independent"),
        Column("McNemar p", rank=3, note="as if every pair were independent"),
        Column("by start p", rank=3, note="permutation of the models within each starting position"),
    )
    rates = Sheet(
        name=f"compare-{name}",
        title=f"A: {a} against B: {b}",
        columns=(
            Column("on", number=False),
            Column("A k/n"),
            Column("A SR %"),
            Column("B k/n"),
            Column("B SR %"),
            Column("A - B", note="paired: mean over the cells, points"),
            Column(
                "95 % interval",
                note="Newcombe's interval of the difference, paired where the test is; points; none of 2 starts",
            ),
            Column("cells", rank=2, note="goals x starting positions that the episodes come from"),
            Column("only A : only B", rank=4, note="pairs of one seed and repetition in which only one succeeded"),
            Column("p", note="the one test that is read; its name is beside it"),
            Column("test", number=False, rank=3),
            Column("Holm p", rank=1, note="p corrected for everything asked together"),
            *(others if all_tests else ()),
        ),
        rows=tuple(_rate_row(rate, comparison.asked, all_tests=all_tests) for rate in comparison.rates),
        notes=(*_shared_goals(comparison), *verdicts(comparison)),
        footnotes=footnotes([comparison.first, comparison.second]),
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
            (
                "Intervals by resampling starting positions as a whole: episodes from one position resemble each "
                f"other. Fewer than {FEWEST_CLUSTERS} positions give none."
            ),
        ),
    )
    return [kept(rates), effects]


def contest_sheet(contest: Contest) -> Sheet:
    """Return several models at once, the best first."""
    notes = []
    if contest.p is not None:
        notes.append(
            f"One test over all: p {compared(contest.p)} that no model differs, on the {contest.cells} cells of "
            f"{contest.starts} starting positions that all were tried in (the models are dealt anew within each "
            "position: Cochran's Q as a permutation test)."
        )
    notes.append(
        "Two models share a letter exactly when their comparison, corrected after Holm for "
        f"{contest.pairs} questions, does not tell them apart; the ranks are those that the comparisons leave open."
    )
    conditions = [one.condition for one in contest.standings]
    return Sheet(
        name="contest",
        title=f"All models on the goals they share: {listed(contest.goals)}",
        columns=(
            Column("rank", number=False, note="between which ranks the model lies, 1 the best"),
            Column("model", number=False),
            Column("k/n"),
            Column("SR %"),
            Column("95 % interval"),
            Column("not told apart", number=False, note="models that share a letter"),
        ),
        rows=tuple(
            row(
                Cell(_ranks(one.ranks.best, one.ranks.worst), one.ranks.best),
                word(one.condition.name),
                of(one.proportion.successes, one.proportion.trials),
                percent(one.proportion.rate),
                interval_percent(one.interval.low, one.interval.high),
                word(one.letters),
            )
            for one in contest.standings
        ),
        notes=tuple(notes),
        footnotes=footnotes(conditions),
    )


def contest_fields(contest: Contest) -> dict[str, Any]:
    """Return several models at once as JSON values."""
    return {
        "goals": list(contest.goals),
        "cells": contest.cells,
        "starts": contest.starts,
        "p": contest.p,
        "questions": contest.pairs,
        "standings": [
            {
                "name": one.condition.name,
                "successes": one.proportion.successes,
                "episodes": one.proportion.trials,
                "success_rate": finite(one.proportion.rate),
                "ci_low": finite(one.interval.low),
                "ci_high": finite(one.interval.high),
                "letters": one.letters,
                "best_rank": one.ranks.best,
                "worst_rank": one.ranks.worst,
            }
            for one in contest.standings
        ],
    }


def _ranks(best: int, worst: int) -> str:
    return str(best) if best == worst else f"{best} to {worst}"


def comparison_fields(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON values; None for what is unknown."""
    return {
        "first": condition_fields(comparison.first),
        "second": condition_fields(comparison.second),
        "questions": comparison.asked,
        "level": comparison.level,
        "rates": [_rate_fields(rate, comparison.level) for rate in comparison.rates],
        "effects": [
            {
                "measure": effect.measure,
                "first": finite(effect.first),
                "second": finite(effect.second),
                "difference": finite(effect.difference),
                "ci_low": finite(effect.interval.low),
                "ci_high": finite(effect.interval.high),
            }
            for effect in comparison.effects
        ],
        "verdicts": list(verdicts(comparison)),
    }


def _shared_goals(comparison: Comparison) -> tuple[str, ...]:
    return tuple(f"Shared goals: {listed(rate.goals[0])}." for rate in comparison.rates if rate.scope == SHARED)


def _rate_row(rate: RateComparison, asked: int, *, all_tests: bool) -> Row:
    # A line of its own below says which goals are shared: a list would break the cell on a narrow terminal.
    scope = {ALL: "all", SHARED: "shared"}.get(rate.scope, rate.scope)
    matches, (mine, theirs), cells = rate.matches, rate.compared, rate.cells
    unknown = Cell(UNKNOWN, -math.inf)
    others = rate.others if all_tests else None
    return row(
        word(scope),
        of(mine.successes, mine.trials),
        percent(mine.rate),
        of(theirs.successes, theirs.trials),
        percent(theirs.rate),
        decimal(100 * rate.difference, 2),
        interval_percent(rate.interval.low, rate.interval.high),
        count(cells[0]) if cells[0] == cells[1] else Cell(f"{cells[0]}, {cells[1]}", cells[0]),
        Cell(f"{matches.only_first} : {matches.only_second}", matches.only_first)
        if matches and matches.pairs
        else unknown,
        p_cell(rate.p),
        word(rate.test),
        p_cell(rate.adjusted_p) if asked > 1 and rate.scope != ALL else unknown,
        *(
            (p_cell(others.fisher_p), p_cell(others.barnard_p), p_cell(others.mcnemar_p), p_cell(others.permutation_p))
            if others
            else ()
        ),
    )


def _rate_fields(rate: RateComparison, level: float) -> dict[str, Any]:
    pairing, matches, (mine, theirs), outlook = rate.pairing, rate.matches, rate.compared, rate.outlook
    others = rate.others
    return {
        "scope": rate.scope,
        "goals_first": list(rate.goals[0]),
        "goals_second": list(rate.goals[1]),
        "successes_first": mine.successes,
        "episodes_first": mine.trials,
        "cells_first": rate.cells[0],
        "planned_first": rate.first.planned,
        "done_first": rate.first.episodes,
        "left_out_first": pairing.left_out[0] if pairing else 0,
        "successes_second": theirs.successes,
        "episodes_second": theirs.trials,
        "cells_second": rate.cells[1],
        "planned_second": rate.second.planned,
        "done_second": rate.second.episodes,
        "left_out_second": pairing.left_out[1] if pairing else 0,
        "paired": pairing is not None,
        "starts": pairing.starts if pairing else None,
        "difference": finite(rate.difference),
        "ci_low": finite(rate.interval.low),
        "ci_high": finite(rate.interval.high),
        "test": rate.test,
        "p": finite(rate.p),
        "adjusted_p": finite(rate.adjusted_p),
        "least_p": rate.reach.p,
        "too_few": rate.reach.too_few(level),
        "covered": rate.covered,
        "significant": rate.covered and rate.significant,
        "matched_pairs": matches.pairs if matches else None,
        "only_first": matches.only_first if matches else None,
        "only_second": matches.only_second if matches else None,
        "other_tests": {name: finite(getattr(others, name)) for name in OtherTests.__dataclass_fields__},
        "outlook": {name: getattr(outlook, name) for name in Outlook.__dataclass_fields__} if outlook else None,
    }


def p_cell(value: float) -> Cell:
    """A cell with a p-value."""
    if math.isfinite(value) and value < 0.001:
        return Cell("< 0.001", value)
    return decimal(value, 3)


def _places(measure: str) -> int:
    return 1 if measure.startswith("actions") else 3


def _plain_interval(low: float, high: float, places: int) -> Cell:
    if not (math.isfinite(low) and math.isfinite(high)):
        return Cell(UNKNOWN, -math.inf)
    return Cell(f"[{low:.{places}f}, {high:.{places}f}]", low)


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None for NaN and the infinities."""
    return float(value) if math.isfinite(value) else None
