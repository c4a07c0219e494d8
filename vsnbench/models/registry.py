"""Finds policies by name: the built-in ones, those of installed plug-ins, and any `package.module:Class`."""

import inspect
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from vsnbench.errors import ModelError, UsageError, VsnbenchError
from vsnbench.harmless_text import error_line
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.plugins import import_factory, none_so_called, plug_ins
from vsnbench.protocol.observation import Sensor

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation

ENTRY_POINT_GROUP = "vsnbench.models"
FLAGS = frozenset({"weights", "model_config", "device", "act_timeout"})
"""The keywords of a policy's constructor that a command line has flags for."""

_BUILT_IN: dict[str, str] = {
    "random": "vsnbench.models.random_walk:RandomWalk",
    "forward": "vsnbench.models.forward:ForwardUntilBlocked",
    "oracle": "vsnbench.models.oracle:Oracle",
    "pirlnav": "vsnbench.models.pirlnav.policy:PIRLNav",
    "vlv": "vsnbench.models.vlv.policy:VLV",
}


def known_models() -> list[str]:
    """Return the names that `create_policy` knows: built-in ones first, then those of plug-ins, sorted."""
    return [*_BUILT_IN, *sorted(set(plug_ins(ENTRY_POINT_GROUP)) - set(_BUILT_IN))]


def create_policy(name: str, isolation: "Isolation | None" = None, **options: Any) -> Policy:
    """Return a new policy; one that has a `close` is to be closed.

    Args:
        name: a built-in model, a plug-in's entry point in the group `vsnbench.models`, `package.module:Class`, or the
            address of a served one, `ws://host:port`.
        isolation: start it in a process of its own.
        options: handed to the policy's constructor.

    Raises:
        UsageError: there is no such model, or it has no such option.
        ModelError: the plug-in cannot be imported or made, or is no policy.
    """
    if isolation is not None:
        from vsnbench.models.remote.isolation import IsolatedPolicy

        return IsolatedPolicy(name, options, isolation)
    where, factory = locate(name)
    try:
        inspect.signature(factory).bind(**options)
    except (TypeError, ValueError) as error:
        takes = list(keywords_of(factory))
        surplus = [f"--{option.replace('_', '-')}" for option in options if option not in takes]
        says = f"takes no {' and no '.join(surplus)}" if surplus else f"cannot be made: {error}"
        flags = [f"--{option.replace('_', '-')}" for option in takes if option in FLAGS]
        others = [option for option in takes if option not in FLAGS]
        also = f", and in Python {', '.join(others)}" if others else ""
        raise UsageError(f"model {name} {says}; it takes {', '.join(flags) or 'no options'}{also}") from error
    try:
        policy = factory(**options)
    except VsnbenchError:
        raise
    except (Exception, SystemExit) as error:
        raise ModelError(f"model {name}: {where} could not be made: {error_line(error)}") from error
    if not isinstance(policy, Policy) or not isinstance(policy.card, ModelCard):
        raise ModelError(
            f"model {name}: {where} is no policy: it needs `card` (a ModelCard), `reset(goal, seed)` and "
            "`act(observation)`"
        )
    if problem := _problem_with(policy.card):
        raise ModelError(f"model {name}: {where}: its card's {problem}")
    return policy


def _problem_with(card: ModelCard) -> str:
    """Return in words which field of a third party's card is not what it should be; empty when all are."""
    words: tuple[object, ...] = (card.name, card.weights_sha256, card.weights_label)
    if not all(isinstance(each, str) for each in words) or not card.name.strip():
        return "name, weights_sha256 and weights_label must be text, and the name not empty"
    sensors: object = card.sensors
    if not isinstance(sensors, frozenset) or not all(isinstance(each, Sensor) for each in sensors):
        return "sensors must be a frozenset of Sensor: frozenset({Sensor.RGB})"
    goals: object = card.goals
    if goals is not None and not (isinstance(goals, frozenset) and all(isinstance(each, str) for each in goals)):
        return "goals must be None or a frozenset of categories: frozenset({'chair'})"
    settings: object = card.settings
    return _unkept(settings, "settings") if isinstance(settings, Mapping) else "settings must be a mapping"


def _unkept(value: object, where: str) -> str:
    """Return in words what of a card's settings the record could not keep; empty when it can keep all."""
    if value is None or isinstance(value, str | bool | int | float):
        return ""
    if isinstance(value, Mapping):
        return next((words for name, each in value.items() if (words := _unkept(each, f"{where}[{name!r}]"))), "")
    if isinstance(value, list | tuple | set | frozenset):
        return next((words for each in value if (words := _unkept(each, f"one of {where}"))), "")
    if type(value).__module__ == "numpy":
        return ""
    return f"{where} must be what JSON has (text, numbers, lists, mappings), not {type(value).__name__}"


def locate(name: str) -> tuple[str, Any]:
    """Return what the name stands for as `module:Class`, and the class or function that makes the policy.

    Raises:
        UsageError: there is no such model.
        ModelError: it cannot be imported, or is nothing that could make a policy.
    """
    if name.startswith(("ws://", "wss://")):
        from vsnbench.models.remote.policy import RemotePolicy

        return name, partial(RemotePolicy, name)
    installed = plug_ins(ENTRY_POINT_GROUP)
    where = _BUILT_IN.get(name) or installed.get(name) or (name if ":" in name else "")
    if not where:
        raise none_so_called("model", name, known_models())
    return where, import_factory(where, "model", name, "a policy", ModelError)


def keywords_of(factory: Any) -> dict[str, str]:
    """Return the keywords that a policy is made with, each with its default as text; empty where it has none."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return {}
    empty = inspect.Parameter.empty
    return {each.name: "" if each.default is empty else repr(each.default)[:40] for each in parameters}


def is_third_party(name: str) -> bool:
    """Whether the name stands for code that is not vsnbench's own; what a served model is, its server says."""
    if name.startswith(("ws://", "wss://")):
        return False
    where = _BUILT_IN.get(name) or plug_ins(ENTRY_POINT_GROUP).get(name) or name
    return where.partition(":")[0].partition(".")[0] != "vsnbench"
