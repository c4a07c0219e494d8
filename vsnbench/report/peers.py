"""Which conditions can be laid beside each other: tested in the same circumstances, with enough trials done."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from vsnbench.report.conditions import Condition

if TYPE_CHECKING:
    from vsnbench.report.summary import ConditionSummary

ENOUGH_COVERAGE = 0.95
"""Below this share of trials done, no winner is named."""

FEWEST_EPISODES = 15
"""With fewer a model is no peer of the others: the paper asks for at least 15 starting positions (Section 4.1)."""


def circumstances(condition: Condition) -> str:
    """Return what must be the same for two models to be laid beside each other: robot, site, protocol, conditions."""
    settings = [dict(condition.protocol), dict(condition.conditions)]
    return json.dumps(
        [condition.robot, condition.simulated, condition.site_sha256, *settings], sort_keys=True, default=str
    )


def is_competitor(one: "ConditionSummary") -> bool:
    """Whether a condition can be laid beside others: not handed the site, enough episodes, nearly all trials done."""
    return not one.condition.surveyed and not shortcoming(one)


def shortcoming(one: "ConditionSummary") -> str:
    """Say why there is too little to compare; empty where there is enough."""
    return _shortcoming(one.total.episodes, one.total.planned)


def _shortcoming(episodes: int, planned: int) -> str:
    if episodes < FEWEST_EPISODES:
        return f"{episodes} episodes, and {FEWEST_EPISODES} are the least"
    if episodes < ENOUGH_COVERAGE * planned:
        return f"{episodes} of {planned} trials done"
    return ""


def shared_goals(
    conditions: Sequence[Condition], asked: Mapping[int, set[str]], done: Mapping[int, tuple[int, int]]
) -> dict[int, set[str]]:
    """Return, by condition number, the goals that it shares with those that it can be laid beside.

    Only competitors say which goals these are: a first try with one goal must not narrow everybody's. Where fewer than
    two compete, all do but those that were handed the site.

    Args:
        conditions: of the report.
        asked: the goals that each was asked for, by number.
        done: episodes that count, and trials planned, of each, by number.
    """
    groups: dict[str, list[Condition]] = {}
    for one in conditions:
        groups.setdefault(circumstances(one), []).append(one)
    shared: dict[int, set[str]] = {}
    for group in groups.values():
        able = [one for one in group if not one.surveyed]
        peers = [one for one in able if not _shortcoming(*done[one.number])]
        goals = [asked[one.number] for one in (peers if len(peers) > 1 else able)]
        common = set.intersection(*goals) if goals else set()
        shared |= {one.number: common for one in group}
    return shared
