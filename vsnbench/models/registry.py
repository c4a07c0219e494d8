"""Finds policies by name: the built-in ones, those of installed plug-ins, and any `package.module:Class`."""

import inspect
from functools import partial
from typing import TYPE_CHECKING, Any

from vsnbench.errors import ModelError, UsageError, VsnbenchError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.plugins import import_factory, plug_ins

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation

ENTRY_POINT_GROUP = "vsnbench.models"

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
        takes = _options_of(factory)
        surplus = [f"--{option.replace('_', '-')}" for option in options if option not in takes]
        says = f"takes no {' and no '.join(surplus)}" if surplus else f"cannot be made: {error}"
        raise UsageError(f"model {name} {says}; it takes {', '.join(takes) or 'no options'}") from error
    try:
        policy = factory(**options)
    except VsnbenchError:
        raise
    except Exception as error:
        raise ModelError(f"model {name}: {where} could not be made: {type(error).__name__}: {error}") from error
    if not isinstance(policy, Policy) or not isinstance(policy.card, ModelCard):
        raise ModelError(
            f"model {name}: {where} is no policy: it needs `card` (a ModelCard), `reset(goal, seed)` and "
            "`act(observation)`"
        )
    return policy


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
        raise UsageError(
            f"no model {name!r}: the known ones are {', '.join(known_models())}; "
            "your own is named as package.module:Class"
        )
    return where, import_factory(where, f"model {name}", "a policy", ModelError)


def _options_of(factory: Any) -> list[str]:
    try:
        return [name for name in inspect.signature(factory).parameters if name != "self"]
    except (TypeError, ValueError):
        return []
