"""Comparisons and rankings as tables and as JSON values."""

from dataclasses import asdict
from typing import Any

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.fields import condition_fields, finite, interval_fields
from vsnbench.report.analysis.published import PAPER_INTERVALS
from vsnbench.report.comparison.compare import ALL, SHARED, Comparison, RateComparison
from vsnbench.report.comparison.ranking import Ranking
from vsnbench.report.comparison.verdicts import verdicts
from vsnbench.report.table import (
    EMPTY,
    Cell,
    Column,
    ReportTable,
    Row,
    decimal,
    interval_cell,
    interval_percent,
    of,
    p_cell,
    percent,
    rate_cells,
    row,
    without_empty_columns,
)
from vsnbench.report.wording import compared, listed
from vsnbench.statistics.bootstrap import MIN_CLUSTERS


def comparison_tables(comparison: Comparison) -> list[ReportTable]:
    """Return the table of success rates with its test, and that of actions and SPL."""
    a, b = comparison.first.name, comparison.second.name
    name = f"{comparison.first.number}-{comparison.second.number}"
    rates = ReportTable(
        name=f"compare-{name}",
        title=f"A: {a}, B: {b}",
        columns=(
            Column("goals", number=False),
            Column("A k/n"),
            Column("A SR %"),
            Column("B k/n"),
            Column("B SR %"),
            Column("A - B", note="difference in success rate, points; if paired, the mean over the cells"),
            Column(
                "95 % interval",
                note="Newcombe's interval of the difference, points; paired if the test is; simultaneous for all "
                "comparisons in Holm's correction; unknown for two starts",
            ),
            Column("cells", rank=2, note="combinations of goal and starting position"),
            Column("only A : only B", rank=4, note="matched episodes of which only one succeeded"),
            Column(
                "p",
                note="two-sided p-value of the test in the next column; a test of starting positions tests whether the "
                "models are equal at every position",
            ),
            Column("test", number=False, rank=3),
            Column("Holm p", rank=1, note="p after Holm's correction for all comparisons"),
        ),
        rows=tuple(_rate_row(rate, comparison.asked) for rate in comparison.rates),
        notes=(*_shared_goals(comparison), *verdicts(comparison), *_of_the_paper(comparison)),
        footnotes=footnotes([comparison.first, comparison.second]),
    )
    if not comparison.effects:
        return [without_empty_columns(rates)]
    effects = ReportTable(
        name=f"effects-{name}",
        title=f"{'Actions and path' if comparison.compares_actions else 'Path'} efficiency on the shared goals",
        columns=(
            Column("measure", number=False),
            Column("A"),
            Column("B"),
            Column("A - B"),
            Column("95 % interval", note="bootstrap of whole starting positions"),
        ),
        rows=tuple(
            row(
                effect.measure,
                decimal(effect.first, _places(effect.measure)),
                decimal(effect.second, _places(effect.measure)),
                decimal(effect.difference, _places(effect.measure)),
                interval_cell(effect.interval, _places(effect.measure)),
            )
            for effect in comparison.effects
        ),
        notes=(
            (
                "Intervals by bootstrap of whole starting positions, whose episodes are correlated. "
                f"Unknown for fewer than {MIN_CLUSTERS} positions or constant values."
            ),
            *_of_other_kinds(comparison),
        ),
    )
    return [without_empty_columns(rates), effects]


def _of_other_kinds(comparison: Comparison) -> tuple[str, ...]:
    if comparison.compares_actions:
        return ()
    a, b = (listed(condition.action_kinds) for condition in (comparison.first, comparison.second))
    return (f"Numbers of actions are not compared: A answers with {a}, B with {b}.",)


def _of_the_paper(comparison: Comparison) -> tuple[str, ...]:
    return (PAPER_INTERVALS,) if comparison.first.published or comparison.second.published else ()


def ranking_table(ranking: Ranking) -> ReportTable:
    """Return the ranking of several models, best first."""
    notes = []
    if ranking.p is not None:
        notes.append(
            f"Overall test: p {compared(ranking.p)} for no difference between the models, on the {ranking.cells} cells "
            f"of {ranking.starts} starting positions that all models share (Cochran's Q as a permutation test within "
            "starting positions)."
        )
    notes.append(
        f"Two models share a letter if their comparison, Holm-corrected for {ranking.pairs} comparisons, shows no "
        "difference. The ranks are those that the comparisons do not exclude."
    )
    conditions = [ranked.condition for ranked in ranking.models]
    return ReportTable(
        name="ranking",
        title=f"All models on their shared goals: {listed(ranking.goals)}",
        columns=(
            Column("rank", number=False, note="best and worst rank of the model; 1 is the best"),
            Column("model", number=False),
            Column("k/n"),
            Column("SR %"),
            Column("95 % interval"),
            Column("group", number=False, note="no difference is shown between models that share a letter"),
        ),
        rows=tuple(
            row(
                Cell(_ranks(ranked.ranks.best, ranked.ranks.worst), ranked.ranks.best),
                ranked.condition.name,
                *rate_cells(ranked.proportion, ranked.interval),
                ranked.letters,
            )
            for ranked in ranking.models
        ),
        notes=tuple(notes),
        footnotes=footnotes(conditions),
    )


def ranking_fields(ranking: Ranking) -> dict[str, Any]:
    """Return a ranking as JSON values."""
    return {
        "goals": list(ranking.goals),
        "cells": ranking.cells,
        "starts": ranking.starts,
        "p": ranking.p,
        "questions": ranking.pairs,
        "models": [
            {
                "name": ranked.condition.name,
                "successes": ranked.proportion.successes,
                "episodes": ranked.proportion.trials,
                "success_rate": finite(ranked.proportion.rate),
                **interval_fields(ranked.interval),
                "letters": ranked.letters,
                "best_rank": ranked.ranks.best,
                "worst_rank": ranked.ranks.worst,
            }
            for ranked in ranking.models
        ],
    }


def _ranks(best: int, worst: int) -> str:
    return str(best) if best == worst else f"{best} to {worst}"


def comparison_fields(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON values; None if unknown."""
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
                **interval_fields(effect.interval),
            }
            for effect in comparison.effects
        ],
        "actions_compared": comparison.compares_actions,
        "verdicts": list(verdicts(comparison)),
    }


def _shared_goals(comparison: Comparison) -> tuple[str, ...]:
    return tuple(f"Shared goals: {listed(rate.goals[0])}." for rate in comparison.rates if rate.scope == SHARED)


def _rate_row(rate: RateComparison, asked: int) -> Row:
    # A note lists the shared goals, because a list in the cell would wrap on a narrow terminal.
    scope = {ALL: "all", SHARED: "shared"}.get(rate.scope, rate.scope)
    matches, (mine, theirs), cells = rate.matches, rate.compared, rate.cells
    return row(
        scope,
        of(mine.successes, mine.trials),
        percent(mine.rate),
        of(theirs.successes, theirs.trials),
        percent(theirs.rate),
        decimal(100 * rate.difference, 2),
        interval_percent(rate.interval),
        cells[0] if cells[0] == cells[1] else Cell(f"{cells[0]}, {cells[1]}", cells[0]),
        Cell(f"{matches.only_first} : {matches.only_second}", matches.only_first)
        if matches and matches.pairs
        else EMPTY,
        p_cell(rate.p),
        rate.test,
        p_cell(rate.adjusted_p) if asked > 1 and rate.scope != ALL else EMPTY,
    )


def _rate_fields(rate: RateComparison, level: float) -> dict[str, Any]:
    pairing, matches, (mine, theirs) = rate.pairing, rate.matches, rate.compared
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
        **interval_fields(rate.interval),
        "test": rate.test,
        "p": finite(rate.p),
        "adjusted_p": finite(rate.adjusted_p),
        "least_p": rate.attainable.p,
        "too_few": rate.attainable.too_few(level),
        "covered": rate.covered,
        "significant": rate.conclusion.names_winner,
        "matched_pairs": matches.pairs if matches else None,
        "only_first": matches.only_first if matches else None,
        "only_second": matches.only_second if matches else None,
        "design_power": asdict(rate.power) if rate.power else None,
    }


def _places(measure: str) -> int:
    return 1 if measure.startswith(("actions", "driving", "thinking", "heading")) else 3
