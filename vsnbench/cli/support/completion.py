"""Shell completion of values: models, goals, sites, robots, protocols, and numbers of recorded episodes.

Completion never fails and never writes: after an error, the shell gets no suggestions.
"""

import inspect
import logging
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, get_args

from typer import Context
from typer.models import ArgumentInfo, OptionInfo

from vsnbench.cli.support.lists import split_list

logger = logging.getLogger(__name__)

_READS_RECORD = frozenset({"report", "compare", "episodes", "export"})
"""Commands whose --model selects recorded models."""
_LATEST_EPISODES = 50

Complete = Callable[..., list[Any]]
"""Function of the incomplete word, and of the context if it reads the record; returns words, or words with help."""


def add_completion(verb: str, function: Callable[..., Any]) -> None:
    """Add completion to the options and arguments of a command, by their names."""
    for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
        for info in get_args(parameter.annotation)[1:]:
            complete = _completion_of(verb, name, info)
            if complete is not None and info.autocompletion is None:
                info.autocompletion = complete


def _completion_of(verb: str, name: str, info: object) -> Complete | None:
    if isinstance(info, OptionInfo):
        of_option: dict[str, Complete] = {
            "--model": recorded_models if verb in _READS_RECORD else known_models,
            "--goal": goals,
            "--site": sites,
            "--robot": robots,
            "--protocol": protocols,
        }
        names = (info.default, *(info.param_decls or ()))  # in an annotation, Typer keeps the first name in `default`
        return next((of_option[option] for option in names if isinstance(option, str) and option in of_option), None)
    if isinstance(info, ArgumentInfo):
        if name in ("number", "numbers", "episode"):
            return episodes
        of_argument: dict[tuple[str, str], Complete] = {
            ("compare", "models"): recorded_models,
            ("models", "name"): known_models,
            ("protocol", "protocol"): protocols,
        }
        return of_argument.get((verb, name))
    return None


def known_models(incomplete: str) -> list[Any]:
    """Return models that can be run by name."""
    from vsnbench.models import names

    return _matching(incomplete, names.known_models)


def recorded_models(context: Context, incomplete: str) -> list[Any]:
    """Return models that have recorded episodes."""
    return _matching(incomplete, lambda: {episode.model for episode in _recorded(context, None)})


def goals(context: Context, incomplete: str) -> list[Any]:
    """Return goal categories, and the categories and goals of the sites that the command would use."""
    from vsnbench.sites.categories import GOAL_CATEGORIES

    return _matching(incomplete, lambda: dict.fromkeys([*GOAL_CATEGORIES, *_goals_of_sites(context), "all"]))


def _goals_of_sites(context: Context) -> list[str]:
    """Return what can be a goal at the sites of `--site` or the default one; nothing of a site that cannot be read."""
    from vsnbench.config import BUILT_IN_SITE, VARIABLE_OF, apply_config_defaults
    from vsnbench.sites.site import load_site

    apply_config_defaults()
    given = context.params.get("site") or os.environ.get(VARIABLE_OF["site"], BUILT_IN_SITE)
    found: list[str] = []
    for name in split_list([given] if isinstance(given, str) else given):
        try:
            site = load_site(name)
        except Exception:
            logger.debug("no goals of %s", name, exc_info=True)
        else:
            found += [*sorted(site.categories), *(goal.id for goal in site.goals)]
    return found


def sites(incomplete: str) -> list[Any]:
    """Return embedded sites; the shell completes paths."""
    from vsnbench.sites.site import embedded_sites

    return _matching(incomplete, embedded_sites)


def robots(incomplete: str) -> list[Any]:
    """Return robots of the package and of plug-ins."""
    from vsnbench.robots.registry import known_robots

    return _matching(incomplete, known_robots)


def protocols(incomplete: str) -> list[Any]:
    """Return named protocols; the shell completes paths."""
    from vsnbench.protocol.named import NAMED

    return _matching(incomplete, lambda: NAMED)


def episodes(context: Context, incomplete: str) -> list[Any]:
    """Return numbers of the latest episodes, each with its model, goal and outcome."""
    try:
        return [
            (str(episode.id), f"{episode.model} {episode.goal} from {episode.start}: {episode.outcome}")
            for episode in reversed(_recorded(context, _LATEST_EPISODES))
            if str(episode.id).startswith(incomplete)
        ]
    except Exception:
        return []


def _matching(incomplete: str, names: Callable[[], Iterable[str]]) -> list[Any]:
    """Complete the last item of a list with commas."""
    before, comma, last = incomplete.rpartition(",")
    try:
        return [f"{before}{comma}{name}" for name in names() if name.startswith(last)]
    except Exception:
        return []


def _recorded(context: Context, limit: int | None) -> Any:
    """Return episodes of the record that the command would read."""
    from vsnbench.config import apply_config_defaults
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.results.reading.queries import list_episodes
    from vsnbench.results.schema.migrate import open_record

    apply_config_defaults()
    given = context.params.get("results")
    results = None if given is None else Path(given)
    place = ResultsDirectory.locate(results, context.params.get("db"))
    with open_record(place.database_url, reads_copy=False) as engine:  # a copy would take too long for a key press
        return list_episodes(engine, EpisodeFilter(), limit)
