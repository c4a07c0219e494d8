"""Creates policies by name: built-in models, installed plug-ins and any `package.module:Class`."""

import inspect
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from vsnbench.errors import ModelError, UsageError, VsnbenchError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.names import class_of, driver_of, is_address, is_human, is_stack, known_models, stack_file
from vsnbench.models.process_exit import process_exit_refused, take_refused_exit
from vsnbench.plugins import import_factory, unknown_name
from vsnbench.runtime.floating_point import floating_point_restored
from vsnbench.settings.validation import first_error
from vsnbench.text.sanitize import error_line
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import copy_of
from vsnbench.values.model.person import HUMAN

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation

FLAGS = frozenset({"weights", "model_config", "device"})
"""Constructor parameters of a policy that are options of the command line."""


def create_policy(name: str, isolation: "Isolation | None" = None, **options: Any) -> Policy:
    """Create a policy. The caller closes it.

    Args:
        name: a built-in model, a plug-in's entry point in the group `vsnbench.models`, `package.module:Class`, or the
            address of a served one, `ws://host:port`, or `stack:FILE.yaml`, or `human:NAME`.
        isolation: settings of the separate process in which to start the model; None for this process.
        options: arguments of the policy's constructor.

    Raises:
        UsageError: the model or an option does not exist.
        ModelError: the class cannot be imported or instantiated, or is not a policy.
    """
    if isolation is not None:
        if is_stack(name) or is_human(name):
            raise UsageError(
                f"--isolate: {name} does not run in a process of vsnbench",
                advice="leave --isolate out",
                code="unknown-model-option",
            )
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
        reason = take_refused_exit() or error_line(error)
        raise invalid_card(name, where, error) or _not_created(name, where, reason) from None
    if refused_exit := take_refused_exit():
        raise _not_created(name, where, refused_exit)
    if not isinstance(policy, Policy):
        raise ModelError(
            f"model {name}: {where} is not a policy",
            advice="write `class MyModel(vsnbench.Policy)` with `card` (a vsnbench.ModelCard), `reset` and `act`",
            code="not-a-policy",
        )
    if not isinstance(getattr(policy, "card", None), ModelCard):
        raise ModelError(
            f"model {name}: {where} has no card",
            advice='set its `card`, for example `card = ModelCard("mine", sensors=frozenset({Sensor.RGB}))`',
            code="not-a-policy",
        )
    if type(policy).survey is not Policy.survey and not policy.needs_survey:
        raise ModelError(
            f"model {name}: {where} implements `survey` but does not ask for it",
            advice="set `needs_survey = True`",
            code="survey-not-declared",
        )
    try:
        copy_of(policy.card)
    except ValidationError as error:
        raise invalid_card(name, where, error) or error from error
    if GoalKind.SEQUENCE in policy.card.goal_kinds and type(policy).next_goal is Policy.next_goal:
        raise ModelError(
            f"model {name}: its card says that it keeps its memory in a sequence, but it has no `next_goal`",
            advice="write `next_goal(goal)`, or leave `sequence` out of goal_kinds: then it begins again at each goal",
            code="next-goal-missing",
        )
    return policy


def _not_created(name: str, where: str, reason: str) -> ModelError:
    return ModelError(f"model {name}: cannot create {where}: {reason}", code="model-not-created")


def invalid_card(name: str, where: str, error: BaseException | None) -> ModelError | None:
    """Return the error of a card that was refused when the model's code created it; None for other errors."""
    if not isinstance(error, ValidationError) or error.title != ModelCard.__name__:
        return None
    field, problem = first_error(error, ModelCard)
    return ModelError(
        f"model {name}: {f'{where}: ' if where != name else ''}its card's {field}: {problem.statement}",
        advice=problem.advice,
        code="invalid-card",
    )


def locate(name: str) -> tuple[str, Any]:
    """Return `module:Class` for a model's name, and the class or function that creates the policy.

    Raises:
        UsageError: the model does not exist.
        ModelError: the class cannot be imported, or its card is invalid.
    """
    if is_address(name):
        from vsnbench.models.remote.policy import RemotePolicy

        return name, partial(RemotePolicy, name)
    if is_stack(name):
        from vsnbench.models.stack.policy import StackPolicy

        return name, partial(StackPolicy, stack_file(name))
    if is_human(name) and name != HUMAN:
        where, factory = locate(HUMAN)
        return where, partial(factory, driver_of(name))
    where = class_of(name)
    if ":" not in where:
        raise unknown_name("model", name, known_models())
    try:
        return where, import_factory(where, "model", name, ModelError)
    except ModelError as error:
        raise invalid_card(name, where, error.__cause__) or error from error.__cause__


def keywords_of(factory: Any) -> dict[str, str]:
    """Return the constructor parameters of a policy with their defaults as text."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return {}
    empty = inspect.Parameter.empty
    return {item.name: "" if item.default is empty else repr(item.default)[:40] for item in parameters}
