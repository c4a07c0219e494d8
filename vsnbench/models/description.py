"""Description of a model's class: what is known without creating the model."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import BaseModel

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.names import is_address, is_human, is_stack, stack_file
from vsnbench.models.registry import keywords_of, locate
from vsnbench.values.model.person import HUMAN


@dataclass(frozen=True, slots=True)
class ModelDescription:
    """A model as its class describes it."""

    name: str
    where: str
    """`module:Class`."""
    summary: str
    keywords: Mapping[str, str]
    """Constructor parameters with their defaults as text; those in `registry.FLAGS` are command line options."""
    card: ModelCard | None
    """Card of the class, which the created model may refine; None if only an instance has one."""
    weights_file: str
    """Name of the weights in the directory of weights; empty if the model has none."""
    settings_class: type[BaseModel] | None
    can_check: bool
    """Whether `check` inspects the model's weights."""


def describe_model(name: str) -> ModelDescription:
    """Describe a model by its class, or a served one by its card.

    Raises:
        UsageError: the model does not exist.
        ModelError: its module cannot be imported, its card is invalid, its server refuses, or its file is invalid.
        ModelLostError: no server answers.
    """
    if is_address(name):
        return _describe_server(name)
    if is_stack(name):
        return _describe_stack(name)
    if is_human(name):
        name = HUMAN
    where, factory = locate(name)
    text = inspect.getdoc(inspect.getmodule(factory)) or inspect.getdoc(factory) or ""
    policy = factory if isinstance(factory, type) and issubclass(factory, Policy) else Policy
    return ModelDescription(
        name=name,
        where=where,
        summary=text.partition("\n")[0].removeprefix(f"The model `{name}`: ").removesuffix("."),
        keywords=keywords_of(factory),
        card=card if isinstance(card := getattr(policy, "card", None), ModelCard) else None,
        weights_file=policy.weights_file,
        settings_class=policy.settings_class,
        can_check=inspect.getattr_static(policy, "check") is not inspect.getattr_static(Policy, "check"),
    )


def _describe_server(url: str) -> ModelDescription:
    from vsnbench.models.remote.policy import RemotePolicy, RemoteSettings

    policy = RemotePolicy(url)
    policy.close()
    card = policy.card
    return ModelDescription(
        name=card.name,
        where=url,
        summary=f"a served model{f', {card.weights_label}' if card.weights_label else ''}",
        keywords={"model_config": "None"},
        card=card,
        weights_file="",
        settings_class=RemoteSettings,
        can_check=False,
    )


def _describe_stack(name: str) -> ModelDescription:
    from vsnbench.models.stack.file import card_of, load_stack

    path = stack_file(name)
    stack = load_stack(path)
    return ModelDescription(
        name=stack.name,
        where=str(path),
        summary=f"a stack that drives itself: {stack.text}",
        keywords={},
        card=card_of(stack, path),
        weights_file="",
        settings_class=None,
        can_check=False,
    )
