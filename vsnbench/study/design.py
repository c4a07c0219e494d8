"""Checks before a study whether its design can show anything."""

from collections.abc import Sequence

from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.power import min_starts
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.looks import earliest_decision
from vsnbench.study.power import pairs_of
from vsnbench.study.stopping import min_units
from vsnbench.study.units import Block
from vsnbench.text.sanitize import counted


def design_error(study: StudyFile, blocks: Sequence[Block]) -> str:
    """Return why no outcome of a plan could lead to a conclusion, or an empty string.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals; results are ignored.
    """
    if study.of_these_cells:
        return _these_cells_error(study, blocks)
    if study.stopping != "plan":
        return ""  # `StudyPlace.of` rejects plans with too few starting positions
    if study.of_margin:
        return _margin_error(study, blocks)
    starts = len({block.start for block in blocks})
    count = f"{starts} starting position{'' if starts == 1 else 's'}"
    if isinstance(study.primary, Rate):
        low, high = study.primary.rate - study.margin, study.primary.rate + study.margin
        best, worst = (_whole_plan(study, starts, succeeds=succeeds) for succeeds in (True, False))
        confidence = 1 - study.alpha
        if rate_interval(best, confidence).low > high or rate_interval(worst, confidence).high < low:
            return ""
        return f"with {count} no outcome can show a rate above or below {study.primary.rate:.0%}; use more positions"
    level = study.alpha / pairs_of(study)
    fewest = min_starts(level)
    if starts >= fewest:
        return ""
    return (
        f"with {count} no outcome can be significant at {level:.3g}: the sign-flip test requires at least {fewest} "
        "starting positions"
    )


def _margin_error(study: StudyFile, blocks: Sequence[Block]) -> str:
    """Return why equal results of all trials would not lie within the margin, or an empty string."""
    if earliest_decision(study, blocks) is not None:
        return ""
    starts = counted(len({block.start for block in blocks}), "starting position")
    return (
        f"with {starts} no outcome can show that a difference is below the margin of {100 * study.margin:g} points; "
        "use more positions or a larger margin"
    )


def _these_cells_error(study: StudyFile, blocks: Sequence[Block]) -> str:
    """Return why a sequential plan has too few blocks for any test, or an empty string.

    In such a plan the remaining blocks cannot reverse a lead before the evidence for it is sufficient.
    """
    if any(min_units(study, blocks[:planned]) is not None for planned in range(1, len(blocks) + 1)):
        return ""
    return (
        f"with {counted(len(blocks), 'block')} no test can be decided; use more goals, starting positions or "
        "repetitions"
    )


def _whole_plan(study: StudyFile, starts: int, *, succeeds: bool) -> Outcomes:
    """Return the outcomes of a complete plan in which all trials succeed or all fail."""
    again = study.repetitions
    return Outcomes(tuple(Cell(start, again * succeeds, again) for start in range(starts) for _ in study.goals))
