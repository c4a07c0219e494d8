"""Conditions that can be compared: same robot, site and protocol, and enough completed trials."""

import json
from collections.abc import Iterable, Mapping, Sequence

from vsnbench.report.analysis.conditions import Condition

MIN_COVERAGE = 0.95
"""Smallest share of completed trials with which a winner is named."""
MIN_EPISODES = 15
"""Smallest number of episodes for a comparison; the paper asks for 15 starting positions (Section 4.1)."""


def circumstances(condition: Condition) -> str:
    """Return a key of what must match for a comparison: robot, site, protocol and conditions."""
    settings = [dict(condition.protocol), dict(condition.conditions)]
    return json.dumps(
        [condition.robot, condition.simulated, condition.site_sha256, *settings], sort_keys=True, default=str
    )


def shortcoming(episodes: int, planned: int) -> str:
    """Return why the data do not suffice for a comparison, or an empty string."""
    if episodes < MIN_EPISODES:
        return f"{episodes} episodes; at least {MIN_EPISODES} are required"
    if episodes < MIN_COVERAGE * planned:
        return f"{episodes} of {planned} trials completed"
    return ""


def shared_goals(
    conditions: Sequence[Condition], asked: Mapping[int, set[str]], done: Mapping[int, tuple[int, int]]
) -> dict[int, set[str]]:
    """Return, by condition number, the goals shared with the conditions it can be compared with.

    Only competitors (models without the site file, enough completed trials) determine these goals, so that a trial run
    with one goal does not reduce the set. With fewer than two competitors, all models without the site file do.

    Args:
        conditions: conditions of the report.
        asked: goals of each condition, by number.
        done: counted episodes and planned trials of each condition, by number.
    """
    groups: dict[str, list[Condition]] = {}
    for member in conditions:
        groups.setdefault(circumstances(member), []).append(member)
    shared: dict[int, set[str]] = {}
    for group in groups.values():
        able = [condition for condition in group if not condition.not_competing]
        competitors = [condition for condition in able if not shortcoming(*done[condition.number])]
        goals = [asked[condition.number] for condition in (competitors if len(competitors) > 1 else able)]
        common = set.intersection(*goals) if goals else set()
        shared |= {condition.number: common for condition in group}
    return shared


def kinds_note(conditions: Iterable[Condition]) -> str:
    """Return that numbers of actions are not comparable, where kinds or executions differ; else empty."""
    conditions = tuple(conditions)
    if len({condition.execution for condition in conditions}) > 1:
        return "Some of these robots drive on while the model thinks, so numbers of actions are not comparable."
    if len({condition.action_kinds for condition in conditions}) < 2:
        return ""
    return "These models answer with different kinds of actions, so their numbers of actions are not comparable."
