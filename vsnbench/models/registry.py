"""Creates policies by name: built-in models, installed plug-ins and any `package.module:Class`."""

import inspect
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from vsnbench.errors import ModelError, UsageError, VsnbenchError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.names import class_of, is_address, known_models
from vsnbench.models.process_exit import process_exit_refused, take_refused_exit
from vsnbench.models.trained_camera import TrainedCamera
from vsnbench.plugins import import_factory, unknown_name
from vsnbench.runtime.floating_point import floating_point_restored
from vsnbench.text.sanitize import error_line
from vsnbench.values.action import can_replace
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Sensor

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation

FLAGS = frozenset({"weights", "model_config", "device"})
"""Constructor parameters of a policy that are options of the command line."""


def create_policy(name: str, isolation: "Isolation | None" = None, **options: Any) -> Policy:
    """Create a policy. The caller closes it.

    Args:
        name: a built-in model, a plug-in's entry point in the group `vsnbench.models`, `package.module:Class`, or the
            address of a served one, `ws://host:port`.
        isolation: settings of the separate process in which to start the model; None for this process.
        options: arguments of the policy's constructor.

    Raises:
        UsageError: the model or an option does not exist.
        ModelError: the class cannot be imported or instantiated, or is not a policy.
    """
    if isolation is not None:
        from vsnbench.models.remote.isolation import IsolatedPolicy

        return IsolatedPolicy(name, options, isolation)
    with process_exit_refused(), floating_point_restored():
        return _created(name, options)


def _created(name: str, options: Mapping[str, Any]) -> Policy:
    where, factory = locate(name)
    try:
        inspect.signature(factory).bind(**options)
    except (TypeError, ValueError) as error:
        accepted = list(keywords_of(factory))
        surplus = [f"--{option.replace('_', '-')}" for option in options if option not in accepted]
        flags = [f"--{option.replace('_', '-')}" for option in accepted if option in FLAGS]
        others = [option for option in accepted if option not in FLAGS]
        raise UsageError(
            f"model {name} does not accept {', '.join(surplus)}" if surplus else f"cannot create model {name}: {error}",
            advice=f"its options: {', '.join(flags) or 'none'}"
            + (f"; its parameters in Python: {', '.join(others)}" if others else ""),
            code="unknown-model-option",
        ) from error
    try:
        policy = factory(**options)
    except (VsnbenchError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise _not_created(name, where, take_refused_exit() or error_line(error)) from None
    if refused_exit := take_refused_exit():
        raise _not_created(name, where, refused_exit)
    if not isinstance(policy, Policy) or not isinstance(getattr(policy, "card", None), ModelCard):
        raise ModelError(
            f"model {name}: {where} is not a policy",
            advice="write `class MyModel(vsnbench.Policy)` with `card` (a vsnbench.ModelCard), `reset` and `act`",
            code="not-a-policy",
        )
    if type(policy).survey is not Policy.survey and not policy.needs_survey:
        raise ModelError(
            f"model {name}: {where} implements `survey` but does not ask for it",
            advice="set `needs_survey = True`",
            code="survey-not-declared",
        )
    if problem := card_problem(policy.card):
        raise ModelError(f"model {name}: {where}: its card's {problem}", code="invalid-card")
    return policy


def _not_created(name: str, where: str, reason: str) -> ModelError:
    return ModelError(f"model {name}: cannot create {where}: {reason}", code="model-not-created")


def card_problem(card: ModelCard) -> str:
    """Return what is wrong with a third party's card, or an empty string."""
    texts: tuple[object, ...] = (card.name, card.weights_sha256, card.weights_label)
    if not all(isinstance(text, str) for text in texts) or not card.name.strip():
        return "name, weights_sha256 and weights_label must be strings, and the name must not be empty"
    if not _is_set_of(card.sensors, Sensor):
        return "sensors must be a frozenset of Sensor: frozenset({Sensor.RGB})"
    if not _is_set_of(card.action_kinds, ActionKind) or not card.action_kinds:
        return "action_kinds must be a frozenset of ActionKind: frozenset({ActionKind.WAYPOINT})"
    if card.goals is not None and not _is_set_of(card.goals, str):
        return "goals must be None or a frozenset of categories: frozenset({'chair'})"
    if not _is_set_of(card.goal_kinds, GoalKind) or not card.goal_kinds:
        return "goal_kinds must be a frozenset of GoalKind: frozenset({GoalKind.TEXT})"
    mapped: object = card.action_map
    if not isinstance(mapped, Mapping) or not all(can_replace(*pair) for pair in mapped.items()):
        return "action_map must map LOOK_UP and LOOK_DOWN to other actions: {Action.LOOK_UP: Action.NOOP}"
    steps: tuple[object, ...] = (card.forward_m, card.turn_deg)
    if not all(size is None or (isinstance(size, int | float) and size > 0) for size in steps):
        return "forward_m and turn_deg must be None or numbers above 0"
    camera: object = card.camera
    if camera is not None and not isinstance(camera, TrainedCamera):
        return "camera must be None or a TrainedCamera: TrainedCamera(mount_height_m=0.88, horizontal_fov_deg=79)"
    settings: object = card.settings
    return _not_serializable(settings, "settings") if isinstance(settings, Mapping) else "settings must be a mapping"


def _is_set_of(value: object, kind: type) -> bool:
    return isinstance(value, frozenset) and all(isinstance(item, kind) for item in value)


def _not_serializable(value: object, where: str) -> str:
    """Return which part of a card's settings cannot be stored as JSON, or an empty string."""
    if value is None or isinstance(value, str | bool | int | float):
        return ""
    if isinstance(value, Mapping):
        problems = (_not_serializable(item, f"{where}[{name!r}]") for name, item in value.items())
        return next(filter(None, problems), "")
    if isinstance(value, list | tuple | set | frozenset):
        return next(filter(None, (_not_serializable(item, f"an item of {where}") for item in value)), "")
    if type(value).__module__ == "numpy":
        return ""
    return f"{where} must be JSON (strings, numbers, lists, mappings), not {type(value).__name__}"


def locate(name: str) -> tuple[str, Any]:
    """Return `module:Class` for a model's name, and the class or function that creates the policy.

    Raises:
        UsageError: the model does not exist.
        ModelError: the class cannot be imported.
    """
    if is_address(name):
        from vsnbench.models.remote.policy import RemotePolicy

        return name, partial(RemotePolicy, name)
    where = class_of(name)
    if ":" not in where:
        raise unknown_name("model", name, known_models())
    return where, import_factory(where, "model", name, ModelError)


def keywords_of(factory: Any) -> dict[str, str]:
    """Return the constructor parameters of a policy with their defaults as text."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return {}
    empty = inspect.Parameter.empty
    return {item.name: "" if item.default is empty else repr(item.default)[:40] for item in parameters}
