"""Check and trials of `vsnbench try`: which trials, and how long they and the check may be for a slow model."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.contract_check import STEPS, durations_s, example_tasks
from vsnbench.models.fit.goal import misfit
from vsnbench.models.process_exit import process_exit_refused, take_refused_exit
from vsnbench.models.registry import create_policy
from vsnbench.runner.setup.trial_setup import close_policy
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site

CHECK_S, TRIAL_S = 5.0, 15.0
"""What a model may take for the decisions of a check, and for those of a trial; a slower one takes fewer."""
MIN_ACTIONS = 10
_EPISODES_OF_CHECK = 10


@contextmanager
def opened_policy(name: str, options: Mapping[str, Any]) -> Iterator[Policy]:
    """Create a policy in this process, which it cannot end, and close it."""
    with process_exit_refused():
        policy = create_policy(name, None, **options)
        try:
            yield policy
        finally:
            close_policy(policy)


def decision_s(policy: Policy, probes: int = 3) -> float:
    """Return the median time of some decisions of a policy; 0 if it makes none, which the check reports."""
    try:
        task = example_tasks(policy.card)[0]
        return statistics.median(durations_s(policy, task, probes))
    except KeyboardInterrupt:
        raise
    except BaseException:  # third-party code can raise anything
        take_refused_exit()
        return 0.0


def steps_of_check(decision_time_s: float) -> int:
    """Return the number of steps of each episode of the check."""
    return STEPS if not decision_time_s else max(2, min(STEPS, int(CHECK_S / _EPISODES_OF_CHECK / decision_time_s)))


def max_actions(decision_time_s: float, protocol: int | None) -> int | None:
    """Return the maximum number of actions of a trial: the protocol's, or fewer for a slow model."""
    possible = int(TRIAL_S / decision_time_s) if decision_time_s else None
    if possible is None or (protocol is not None and possible >= protocol):
        return protocol
    return max(MIN_ACTIONS, possible)


def first_goal(card: ModelCard, site: Site) -> str:
    """Return the first goal of a site that a model takes: categories in the order of the paper, then its own goals.

    Raises:
        UsageError: it takes none of them.
    """
    names = [*(goal for goal in GOAL_CATEGORIES if goal in site.categories), *(goal.id for goal in site.goals)]
    if fitting := [name for name in names if not misfit(card, site, name)]:
        return fitting[0]
    raise UsageError(
        f"site {site.name} has no goal that model {card.name} takes: {misfit(card, site, names[0]) if names else ''}",
        advice="give --site with a file that has one",
        code="goal-kind",
    )


def first_starts(goals: Sequence[str], site: Site, count: int = 2) -> tuple[int, ...]:
    """Return the first starting positions from which all of these goals have trials; all if there are none."""
    numbers = [start.number for start in site.starts]
    return tuple(number for number in numbers if not any((goal, number) in site.excluded for goal in goals))[:count]
