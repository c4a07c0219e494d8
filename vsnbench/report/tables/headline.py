"""The success rate that represents each condition among several, and the goals it covers."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.analysis.summary import ConditionSummary, Group
from vsnbench.report.wording import listed


@dataclass(frozen=True, slots=True)
class Headlines:
    """The representative rate of each of several conditions, and the goals they cover."""

    by_condition: tuple[tuple[tuple[str, ...], Group], ...]
    """Goals and representative group of each condition, in their order."""
    label: str
    """Heading of the column: `all`, `shared` or `own goals`."""
    description: str
    """The goals for a title: `all goals`, `the shared goals (bed, chair)` or `each model's own goals`."""


def headlines(conditions: Sequence[ConditionSummary]) -> Headlines:
    """Return the representative rates of several conditions.

    Conditions with the same goals use all of them, others the goals shared with their competitors. If these differ
    between conditions, each uses its own goals.
    """
    own = tuple((summary.own_goals, summary.total) for summary in conditions)
    if len({goals for goals, _ in own}) <= 1:
        return Headlines(own, "all", "all goals")
    shared = tuple(
        (summary.shared_goals, summary.shared) if summary.shared else (summary.own_goals, summary.total)
        for summary in conditions
    )
    if len({goals for goals, _ in shared}) == 1:
        return Headlines(shared, "shared", f"the shared goals ({listed(shared[0][0])})")
    return Headlines(own, "own goals", "each model's own goals")
