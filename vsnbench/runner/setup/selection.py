"""Site, starts and goals of a campaign, and the trials that follow from them, in order."""

import logging
from collections.abc import Container, Sequence
from difflib import get_close_matches

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.models.fit.goal import misfit
from vsnbench.results.writing.campaigns import Trial
from vsnbench.sites.categories import CATEGORIES, GOAL_CATEGORIES, canonical_category, near_category
from vsnbench.sites.site import Site, embedded_sites, load_site
from vsnbench.sites.targets import kind_of, legs_of
from vsnbench.text.number_ranges import read_numbers
from vsnbench.text.suggestions import closest

logger = logging.getLogger(__name__)


def plan_trials(
    goals: Sequence[str],
    starts: Sequence[int],
    repetitions: int,
    excluded: Container[tuple[str, int]] = (),
) -> tuple[Trial, ...]:
    """Return goals x starting positions x repetitions in the order of running, without `Site.excluded` pairs.

    Raises:
        UsageError: no trial is left.
    """
    trials = [
        Trial(goal, start, repetition)
        for repetition in range(1, repetitions + 1)
        for goal in goals
        for start in starts
        if (goal, start) not in excluded
    ]
    if not trials:
        raise UsageError(
            "the site excludes every requested goal from every requested starting position "
            "(not_for of the start, or starts of the goal)",
            code="no-trials",
        )
    return tuple(trials)


def choose_goals(names: Sequence[str], site: Site, card: ModelCard) -> tuple[str, ...]:
    """Return the goals of a campaign, checked against the model.

    `names` are those of `resolve_goals`; `all` means every goal category of the paper that the site has and the model
    knows.

    Raises:
        UsageError: the model cannot take a goal (`unknown-goal`, `goal-kind`).
    """
    if "all" in names:
        possible = [goal for goal in _of_the_paper(site) if not misfit(card, site, goal)]
        if not possible:
            raise UsageError(
                f"site {site.name} has none of the goals that model {card.name} knows",
                advice=_misnamed(card),
                code="unknown-goal",
            )
        return tuple(possible)
    for name in names:
        if problem := misfit(card, site, name):
            wrong_kind = any(kind_of(site, leg) not in card.goal_kinds for leg in legs_of(site, name))
            raise UsageError(
                problem,
                advice=_fitting_goals(site, card) if wrong_kind else _misnamed(card),
                code="goal-kind" if wrong_kind else "unknown-goal",
            )
    return tuple(names)


def resolve_goals(requested: Sequence[str], site: Site) -> tuple[str, ...]:
    """Return the goals of a site that words name, each once; keeps `all`.

    `requested` has ids of goals and categories of the site, separated by commas or as items.

    Raises:
        UsageError: the site lacks a goal (`unknown-goal`), or no goal was given (`no-goal`).
    """
    return tuple(dict.fromkeys(_resolved(name, site) for name in named_goals(requested)))


def goals_of_flats(requested: Sequence[str], sample: Site) -> tuple[str, ...]:
    """Return the goals of generated sites that words name, each once; keeps `all`. A site may lack some of them.

    Raises:
        UsageError: no generated site has a goal (`unknown-goal`), or no goal was given (`no-goal`).
    """
    present, absent = present_goals(named_goals(requested), sample)
    if lost := [name for name in absent if canonical_category(name) not in CATEGORIES]:
        known = [name for name in sorted(CATEGORIES) if near_category(lost[0]) == name]
        advice = f"did you mean {known[0]!r}?" if known else f"their goals are {', '.join(sorted(CATEGORIES))}"
        raise UsageError(f"no generated flat has goal {lost[0]!r}", advice=advice, code="unknown-goal")
    names = (*(_resolved(name, sample) for name in present), *map(canonical_category, absent))
    return tuple(dict.fromkeys(names))


def present_goals(names: Sequence[str], site: Site) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of goals that a site has, and those that it lacks."""
    absent = tuple(name for name in names if not _has(site, name))
    return tuple(name for name in names if name not in absent), absent


def _has(site: Site, name: str) -> bool:
    return name == "all" or site.goal(name) is not None or canonical_category(name) in site.categories


def check_goal_starts(goals: Sequence[str], starts: Sequence[int], site: Site) -> None:
    """Check that each goal that holds for some starting positions only has trials from the requested ones.

    Logs a warning if a goal has trials from a part of them. The goals are ids and categories, or `all`.

    Raises:
        UsageError: a goal has none (`goal-start`).
    """
    for goal in filter(None, map(site.goal, goals)):
        missing = [number for number in starts if goal.starts and number not in goal.starts]
        if not missing:
            continue
        own = f"its starts are {', '.join(map(str, sorted(goal.starts)))}"
        starts_text = f"start{'' if len(missing) == 1 else 's'} {', '.join(map(str, missing))}"
        if len(missing) == len(starts):
            raise UsageError(f"goal {goal.id!r} does not hold from {starts_text}", advice=own, code="goal-start")
        logger.warning("goal %s has no trials from %s: %s", goal.id, starts_text, own)


def _resolved(name: str, site: Site) -> str:
    if name == "all" or site.goal(name) is not None or name in site.categories:
        return name
    category = canonical_category(name)
    if category in site.categories:
        return category
    known = [*(goal.id for goal in site.goals), *site.categories]
    near = near_category(name)
    where = f"goal {name!r} is not in site {site.name!r}"
    if suggestion := near if near in site.categories else closest(name, known):
        raise UsageError(where, advice=f"did you mean {suggestion!r}?", code="unknown-goal")
    first = [*(goal.id for goal in site.goals), *_of_the_paper(site)]
    more = len(site.categories) - len(_of_the_paper(site))
    others = f" and {more} other categories" if more else ""
    raise UsageError(where, advice=f"it has {', '.join(first[:_LISTED]) or 'no goals'}{others}", code="unknown-goal")


_LISTED = 20


def named_goals(requested: Sequence[str]) -> list[str]:
    """Return the requested names of goals as typed.

    Raises:
        UsageError: no goal was given (`no-goal`).
    """
    names = [name.strip() for text in requested for name in text.split(",") if name.strip()]
    if not names:
        raise UsageError("no goal given", advice="give --goal chair, for example, or --goal all", code="no-goal")
    return names


def max_goals(names: Sequence[str], site: Site) -> int:
    """Return the maximum number of goals that `choose_goals` can return for any model."""
    return len(possible_goals(names, site))


def possible_goals(names: Sequence[str], site: Site) -> tuple[str, ...]:
    """Return the goals that `choose_goals` can return for any model."""
    return tuple(_of_the_paper(site) if "all" in names else names)


def _of_the_paper(site: Site) -> list[str]:
    return [goal for goal in GOAL_CATEGORIES if goal in site.categories]


def _fitting_goals(site: Site, card: ModelCard) -> str:
    fitting = [
        name for name in (*(goal.id for goal in site.goals), *_of_the_paper(site)) if not misfit(card, site, name)
    ]
    return f"it can take {', '.join(fitting)}" if fitting else "no goal of the site fits it"


def _misnamed(card: ModelCard) -> str:
    """Return a hint about goals of a card that are spelled differently from the protocol's; empty for none."""
    strange = sorted(goal for goal in card.goals or () if canonical_category(goal) not in GOAL_CATEGORIES)
    near = [(goal, meant[0]) for goal in strange if (meant := get_close_matches(goal, GOAL_CATEGORIES, 1, 0.75))]
    return "; ".join(f"its card has {goal}; did you mean {suggestion}?" for goal, suggestion in near)


def choose_starts(requested: str | None, site: Site) -> tuple[int, ...]:
    """Return the numbers of starting positions in text like `1-15,20`; all of the site's for None.

    Raises:
        UsageError: the text is not numbers and ranges, or the site lacks a position.
    """
    if requested is None:
        return tuple(start.number for start in site.starts)
    numbers = read_numbers(requested, "--starts", "1-15,20", check_last=site.start)
    for number in numbers:
        site.start(number)
    return numbers


FLAT = "flat:"
"""Prefix of the seed of a generated site: `flat:7`."""


def named_site(name: str) -> Site:
    """Return the site that `--site` names: an embedded one, a file, or a generated one such as `flat:7`.

    Raises:
        UsageError: the site does not exist.
        SiteError: the file is not valid, or no site can be generated from the seed.
    """
    if not name.startswith(FLAT):
        return load_site(name)
    number = name.removeprefix(FLAT)
    if not number.isdecimal() or int(number) >= 2**63:
        raise UsageError(f"cannot read --site {name}", advice="give the seed of a generated site, like flat:7")
    from vsnbench.simulator.generated_sites.generate import generate_site

    return generate_site(int(number))


def is_surveyed(name: str) -> bool:
    """Return whether a site is the user's own, which needs a check."""
    return not name.startswith(FLAT) and name not in embedded_sites()
