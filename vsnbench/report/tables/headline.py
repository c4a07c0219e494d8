"""The success rate that represents each condition among several, and the goals it covers."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.analysis.summary import ConditionSummary, Summary
from vsnbench.report.wording import listed


@dataclass(frozen=True, slots=True)
class Headline:
    """The representative rate of a condition."""

    goals: tuple[str, ...]
    summary: Summary


@dataclass(frozen=True, slots=True)
class Headlines:
    """The representative rate of each of several conditions, and the goals they cover."""

    by_condition: tuple[Headline, ...]
    """In the order of the conditions."""
    label: str
    """Heading of the column: `all`, `shared` or `own goals`."""
    description: str
    """The goals for a title: `all goals`, `the shared goals (bed, chair)` or `each model's own goals`."""


def headlines(conditions: Sequence[ConditionSummary]) -> Headlines:
    """Return the representative rates of several conditions.

    Conditions with the same goals use all of them, others the goals shared with their competitors. If these differ
    between conditions, each uses its own goals.
    """
    own = [tuple(goal.goal for goal in summary.goals) for summary in conditions]
    if len(set(own)) <= 1:
        found = tuple(Headline(goals, summary.total) for goals, summary in zip(own, conditions, strict=True))
        return Headlines(found, "all", "all goals")
    found = tuple(
        Headline(summary.shared_goals, summary.shared) if summary.shared else Headline(goals, summary.total)
        for goals, summary in zip(own, conditions, strict=True)
    )
    if len({headline.goals for headline in found}) == 1:
        return Headlines(found, "shared", f"the shared goals ({listed(found[0].goals)})")
    found = tuple(Headline(goals, summary.total) for goals, summary in zip(own, conditions, strict=True))
    return Headlines(found, "own goals", "each model's own goals")
