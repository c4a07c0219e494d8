"""What a run is about: the site, starts and goals that somebody asks for, and the trials that they make, in order."""

import random
from collections.abc import Callable, Container, Sequence
from difflib import get_close_matches

from vsnbench.database.campaign_plan import PlannedTrial
from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.categories import GOAL_CATEGORIES, meant_category
from vsnbench.protocol.site import Site, embedded_sites, load_site


def plan_trials(
    goals: Sequence[str],
    starts: Sequence[int],
    repetitions: int,
    shuffle_seed: int | None = None,
    excluded: Container[tuple[str, int]] = (),
) -> tuple[PlannedTrial, ...]:
    """Return goals x starting positions x repetitions in the order in which they are run.

    Args:
        goals: goal categories.
        starts: numbers of starting positions.
        repetitions: how often each goal meets each start.
        shuffle_seed: run them in the random order that follows from it; in the order given when None.
        excluded: goals with a starting position that is not for them (`Site.excluded`).

    Raises:
        UsageError: nothing is left to run.
    """
    trials = [
        PlannedTrial(goal, start, repetition)
        for repetition in range(1, repetitions + 1)
        for goal in goals
        for start in starts
        if (goal, start) not in excluded
    ]
    if not trials:
        raise UsageError("the site excludes every goal asked for from every starting position asked for (not_for)")
    if shuffle_seed is not None:
        random.Random(shuffle_seed).shuffle(trials)  # noqa: S311 - an order, not a secret
    return tuple(trials)


def choose_goals(asked: Sequence[str], site: Site, card: ModelCard) -> tuple[str, ...]:
    """Return the goal categories of a campaign, checked against what the site has and the model knows.

    Args:
        asked: categories, separated by commas or given one by one; `all` means every goal category of the paper
            that the site has and the model knows.
        site: where it happens.
        card: the model's.

    Raises:
        UsageError: a goal that is no category, that the site lacks or that the model does not know.
    """
    names = named_goals(asked)
    here = [goal for goal in GOAL_CATEGORIES if goal in site.categories]
    possible = [goal for goal in here if card.goals is None or goal in card.goals]
    if "all" in names:
        if not possible:
            raise UsageError(
                f"site {site.name} has none of the goals that model {card.name} knows", advice=_misnamed(card)
            )
        return tuple(possible)
    for name in names:
        if name not in here:
            raise UsageError(f"site {site.name} has no {name}; it has {', '.join(here)}")
        if name not in possible:
            knows = ", ".join(sorted(card.goals or ()))
            raise UsageError(f"model {card.name} does not know {name}; it knows {knows}", advice=_misnamed(card))
    return tuple(dict.fromkeys(names))


def named_goals(asked: Sequence[str]) -> list[str]:
    """Return the goal categories that are asked for, `all` as it stands.

    Raises:
        UsageError: one is no category, or there is none.
    """
    names = [name.strip() for text in asked for name in text.split(",") if name.strip()]
    for name in names:
        if name != "all" and name not in GOAL_CATEGORIES:
            meant = meant_category(name, GOAL_CATEGORIES).partition(";")[0]
            likely = "" if meant.startswith("known") else f"{meant}{'' if meant.endswith('?') else ';'} "
            raise UsageError(f"no goal category {name!r}; {likely}there are {', '.join(GOAL_CATEGORIES)}, or all")
    if not names:
        raise UsageError("no goal given", advice="name one with --goal, for example --goal chair or --goal all")
    return names


def most_goals(asked: Sequence[str], site: Site) -> int:
    """Return how many goals `choose_goals` would choose at most, whatever the model knows."""
    names = {name.strip() for text in asked for name in text.split(",")}
    here = [goal for goal in GOAL_CATEGORIES if goal in site.categories]
    return len(here) if "all" in names else len(names)


def _misnamed(card: ModelCard) -> str:
    """Say which goals of a card are written otherwise than the protocol's; empty for none."""
    strange = sorted(goal for goal in card.goals or () if goal not in GOAL_CATEGORIES)
    near = [(goal, meant[0]) for goal in strange if (meant := get_close_matches(goal, GOAL_CATEGORIES, 1, 0.75))]
    return "; ".join(f"its card says {goal}, did it mean {meant}?" for goal, meant in near)


def choose_starts(asked: str | None, site: Site) -> tuple[int, ...]:
    """Return the numbers of starting positions named by text like `1-15,20`; all of the site's for None.

    Raises:
        UsageError: not numbers and ranges, or a position that the site does not have.
    """
    if asked is None:
        return tuple(start.number for start in site.starts)
    numbers = read_numbers(asked, "--starts", "1-15,20", last=site.start)
    for number in numbers:
        site.start(number)
    return numbers


MOST_NUMBERS = 100_000
"""More than anybody means; a range of so many is a slip of the finger."""


def read_numbers(
    asked: str, option: str, example: str, last: Callable[[int], object] = lambda _: None, *, typed: str = ""
) -> tuple[int, ...]:
    """Return the numbers that text like `0-9,12` stands for, each once, in its order.

    Args:
        asked: numbers and ranges, separated by commas.
        option: where it was given, for errors.
        example: of what is meant, for errors.
        last: sees the last number of each part before the part is written out; may refuse it.
        typed: all that was given there, of which `asked` is a part, for errors; `asked` itself when empty.

    Raises:
        UsageError: it is none.
    """
    numbers: dict[int, None] = {}
    where = f"{option} {typed or asked}"
    for part in asked.split(","):
        first, dash, end = part.strip().partition("-")
        if not first.isdecimal() or (dash and not end.isdecimal()):
            raise UsageError(
                f"cannot read {part.strip()!r} in {where}", advice=f"give numbers and ranges, like {example}"
            )
        chosen = range(int(first), int(end if dash else first) + 1)
        if not chosen:
            raise UsageError(f"the range {part.strip()} in {where} is empty", advice="give the smaller number first")
        last(chosen[-1])
        if len(chosen) > MOST_NUMBERS or chosen[-1] >= 2**63:
            raise UsageError(f"the range {part.strip()} in {where} has too many or too large numbers")
        numbers |= dict.fromkeys(chosen)
    return tuple(numbers)


TWIN = "twin:"
"""Before a number, as a site: the flat that is generated from that seed."""


def named_site(name: str) -> Site:
    """Return the site that `--site` names: an embedded one, a file, or a generated flat, `twin:7`.

    Raises:
        UsageError: there is no such site.
        SiteError: the file breaks the format, or the seed gives no flat.
    """
    if not name.startswith(TWIN):
        return load_site(name)
    number = name.removeprefix(TWIN)
    if not number.isdecimal() or int(number) >= 2**63:
        raise UsageError(f"cannot read --site {name}", advice="give the seed of a generated flat, like twin:7")
    from vsnbench.simulator.twins.generate import generate_site

    return generate_site(int(number))


def is_surveyed(name: str) -> bool:
    """Say whether a site is somebody's own, which nobody has checked."""
    return not name.startswith(TWIN) and name not in embedded_sites()
