"""Comparisons of two conditions: measures and tables."""

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.published import PAPER_INTERVALS
from vsnbench.report.comparison.compare import ALL, SHARED, Comparison, RateComparison
from vsnbench.report.comparison.looks import looks_sentences
from vsnbench.report.comparison.verdicts import verdicts
from vsnbench.report.measures import (
    CELL,
    COUNT,
    FLAG,
    NUMBER,
    NUMBERS,
    RATIO,
    TEXT,
    TEXTS,
    Form,
    Measure,
    Measures,
    P,
    an_object,
    decimals,
    intervals,
    objects,
    percents,
    values,
)
from vsnbench.report.table import EMPTY, ReportTable, TableCell, decimal, interval_cell, without_empty_columns
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.wording import listed
from vsnbench.statistics.bootstrap import MIN_CLUSTERS


def _side(side: int, word: str) -> tuple[Measure, ...]:
    """Return the measures of the first or the second condition, in the compared episodes and on these goals."""
    letter, group = "AB"[side], ("first", "second")[side]
    of_it = f"of the {word} condition"
    return (
        Measure(
            f"successes_{word}",
            COUNT,
            f"successes {of_it} in the compared episodes",
            lambda rate: rate.compared[side].successes,
        ),
        Measure(f"episodes_{word}", COUNT, f"compared episodes {of_it}", lambda rate: rate.compared[side].trials),
        Measure(
            f"cells_{word}",
            COUNT,
            f"cells (goal and starting position) of the compared episodes {of_it}",
            lambda rate: rate.cells[side],
        ),
        Measure(
            f"planned_{word}",
            COUNT,
            f"planned trials {of_it} on these goals",
            lambda rate: getattr(rate, group).planned,
        ),
        Measure(
            f"done_{word}",
            COUNT,
            f"counted episodes {of_it} on these goals, compared or left out",
            lambda rate: getattr(rate, group).episodes,
        ),
        Measure(
            f"left_out_{word}",
            COUNT,
            f"episodes {of_it} in cells that the other condition does not have",
            lambda rate: rate.pairing.left_out[side] if rate.pairing else 0,
        ),
        Measure(
            "",
            RATIO,
            of=lambda rate: (rate.compared[side].successes, rate.compared[side].trials),
            heading=f"{letter} k/n",
        ),
        Measure("", percents(), of=lambda rate: rate.compared[side].rate, heading=f"{letter} SR %"),
    )


def _matched(name: str, meaning: str) -> Measure:
    null = "for independent samples"
    key = "matched_pairs" if name == "pairs" else name
    return Measure(key, COUNT, meaning, lambda rate: getattr(rate.matches, name) if rate.matches else None, null=null)


def _scope(rate: RateComparison) -> str:
    # A note lists the shared goals, because a list in the cell would wrap on a narrow terminal.
    return {ALL: "all", SHARED: "shared"}.get(rate.scope, rate.scope)


def _cells(rate: RateComparison) -> TableCell:
    a, b = rate.cells
    return TableCell(str(a) if a == b else f"{a}, {b}", a)


def _only(rate: RateComparison) -> TableCell:
    matches = rate.matches
    if not (matches and matches.pairs):
        return EMPTY
    return TableCell(f"{matches.only_first} : {matches.only_second}", matches.only_first)


_RATE_A_B = "difference in success rate, points; if paired, the mean over the cells"
_NEWCOMBE = (
    "Newcombe's interval of the difference, points; paired if the test is; simultaneous for all comparisons in Holm's "
    "correction; unknown for two starts"
)
_P = (
    "two-sided p-value of the test in the next column; a test of starting positions tests whether the models are equal "
    "at every position"
)
_TRIALS = "paired: episodes per cell and model; otherwise trials of the model with fewer"
_TRIALS_NEEDED, _STARTS_NEEDED = "`trials` needed", "starting positions needed"
_OBSERVED = "for the observed difference"
POWER = Measures(
    Measure("level", Form({"type": "number"}), "significance level: 0.05 divided by the number of questions"),
    Measure(
        "detectable",
        NUMBER,
        "smallest difference that is found with 80 % power",
        null="if there is none or it is not computed",
    ),
    Measure("paired", FLAG, "the same cells are compared"),
    Measure("trials", COUNT, _TRIALS),
    Measure(
        "trials_needed", COUNT, f"{_TRIALS_NEEDED} {_OBSERVED}", null="if no number suffices or the rates are equal"
    ),
    Measure("starts", COUNT, "starting positions of the model with fewer", null="for independent trials"),
    Measure("starts_needed", COUNT, f"{_STARTS_NEEDED} {_OBSERVED}", null="above 1,000 or if the rates are equal"),
    Measure("assumed", FLAG, "no cell has repetitions, so their correlation is assumed"),
    Measure("different", FLAG, "the observed rates differ"),
)
RATE = Measures(
    Measure("scope", TEXT, "`all goals`, `shared goals` or the name of a goal"),
    Measure("", TEXT, of=_scope, heading="goals"),
    Measure("goals_first", TEXTS, "goals of the first condition", lambda rate: rate.goals[0]),
    Measure("goals_second", TEXTS, "goals of the second condition", lambda rate: rate.goals[1]),
    *_side(0, "first"),
    *_side(1, "second"),
    Measure(
        "paired",
        FLAG,
        "cells that both conditions have are compared with each other; false for independent samples",
        lambda rate: rate.pairing is not None,
    ),
    Measure(
        "starts",
        COUNT,
        "number of shared starting positions",
        lambda rate: rate.pairing.starts if rate.pairing else None,
        null="for independent samples",
    ),
    Measure(
        "difference",
        decimals(2, 100),
        "first success rate minus the second",
        null="without episodes",
        heading="A - B",
        note=_RATE_A_B,
    ),
    Measure(
        "ci",
        intervals(),
        "the 95 % interval of the difference",
        "interval",
        heading="95 % interval",
        note=_NEWCOMBE,
    ),
    Measure("", CELL, "combinations of goal and starting position", _cells, heading="cells", rank=2),
    Measure("", CELL, "matched episodes of which only one succeeded", _only, heading="only A : only B", rank=4),
    Measure("test", TEXT, "name of the test", heading="test", note="", rank=3),
    Measure("p", P, "two-sided p-value before correction", heading="p", note=_P),
    Measure("adjusted_p", NUMBER, "p-value after Holm's correction for all questions"),
    Measure(
        "",
        P,
        "p after Holm's correction for all comparisons",
        lambda rate: rate.adjusted_p if rate.questions > 1 else None,
        heading="Holm p",
        rank=1,
    ),
    Measure("least_p", NUMBER, "smallest p-value that the design can give", "attainable.p"),
    Measure(
        "too_few",
        FLAG,
        "the design has too few starting positions for any conclusion at `level`",
        lambda rate: rate.attainable.too_few(rate.level),
    ),
    Measure("covered", FLAG, "enough planned trials of both conditions are done to name a winner"),
    Measure(
        "significant",
        FLAG,
        "a difference is shown: the test rejects and the interval excludes 0",
        "conclusion.names_winner",
    ),
    _matched("pairs", "number of pairs of matched episodes"),
    _matched("only_first", "pairs in which only the first condition succeeded"),
    _matched("only_second", "pairs in which only the second condition succeeded"),
    Measure(
        "design_power",
        an_object(POWER),
        "power of the design",
        "power",
        null="if a difference was found or the power is unknown",
    ),
).in_columns(
    *("goals", "A k/n", "A SR %", "B k/n", "B SR %", "A - B", "95 % interval", "cells", "only A : only B"),
    *("p", "test", "Holm p"),
)
"""Measures of a `RateComparison`."""


def _mean(name: str, heading: str, meaning: str) -> tuple[Measure, Measure]:
    """Return the measure of a mean for JSON, and for tables with the decimals of the quantity."""
    return (
        Measure(name, NUMBER, meaning),
        Measure("", CELL, of=lambda effect: decimal(getattr(effect, name), _places(effect.measure)), heading=heading),
    )


_BOOTSTRAP = "bootstrap of whole starting positions"
EFFECT = Measures(
    Measure("measure", TEXT, "name of the measure", heading="measure", note=""),
    *_mean("first", "A", "mean of the first condition"),
    *_mean("second", "B", "mean of the second condition"),
    *_mean("difference", "A - B", "first mean minus the second"),
    Measure("ci", intervals(), "the 95 % interval of the difference", "interval"),
    Measure(
        "",
        CELL,
        _BOOTSTRAP,
        lambda effect: interval_cell(effect.interval, _places(effect.measure)),
        heading="95 % interval",
    ),
)
_LOOKS = "episodes of both conditions at each look with new outcomes, this one last"
COMPARISON = Measures.shared(
    "comparison",
    Measure("first", an_object(CONDITION), "first condition"),
    Measure("second", an_object(CONDITION), "second condition"),
    Measure("questions", COUNT, "number of p-values in the Holm correction", "asked"),
    Measure("level", Form({"type": "number"}), "Bonferroni level: 0.05 divided by `questions`"),
    Measure("rates", objects(RATE), "success rates, one object per scope"),
    Measure("effects", objects(EFFECT), "differences in other measures on the shared goals, one object per measure"),
    Measure(
        "actions_compared",
        FLAG,
        "numbers of actions are comparable: both models answer with the same kinds of actions",
        "compares_actions",
    ),
    Measure("verdicts", TEXTS, "conclusions, one sentence each", verdicts),
    Measure("looks", values(NUMBERS), _LOOKS, only_in="`compare`"),
)


def comparison_tables(comparison: Comparison) -> list[ReportTable]:
    """Return the table of success rates with its test, and that of actions and SPL."""
    a, b = comparison.first.name, comparison.second.name
    name = f"{comparison.first.number}-{comparison.second.number}"
    rates = RATE.table(
        f"compare-{name}",
        f"A: {a}, B: {b}",
        comparison.rates,
        notes=(
            *_shared_goals(comparison),
            *verdicts(comparison),
            *looks_sentences(comparison.looks),
            *_of_the_paper(comparison),
        ),
        footnotes=footnotes([comparison.first, comparison.second]),
    )
    if not comparison.effects:
        return [without_empty_columns(rates)]
    bootstrap = (
        "Intervals by bootstrap of whole starting positions, whose episodes are correlated. "
        f"Unknown for fewer than {MIN_CLUSTERS} positions or constant values."
    )
    title = f"{'Actions and path' if comparison.compares_actions else 'Path'} efficiency on the shared goals"
    notes = (bootstrap, *_of_other_kinds(comparison))
    return [without_empty_columns(rates), EFFECT.table(f"effects-{name}", title, comparison.effects, notes=notes)]


def _of_other_kinds(comparison: Comparison) -> tuple[str, ...]:
    if comparison.compares_actions:
        return ()
    a, b = (listed(condition.action_kinds) for condition in (comparison.first, comparison.second))
    return (f"Numbers of actions are not compared: A answers with {a}, B with {b}.",)


def _of_the_paper(comparison: Comparison) -> tuple[str, ...]:
    return (PAPER_INTERVALS,) if comparison.first.published or comparison.second.published else ()


def _shared_goals(comparison: Comparison) -> tuple[str, ...]:
    return tuple(f"Shared goals: {listed(rate.goals[0])}." for rate in comparison.rates if rate.scope == SHARED)


def _places(measure: str) -> int:
    return 1 if measure.startswith(("actions", "driving", "thinking", "heading")) else 3
