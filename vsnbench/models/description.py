"""What can be said about a model without its weights, and what a check of its weights found."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel

from vsnbench.models.registry import keywords_of, locate
from vsnbench.protocol.observation import Sensor


@dataclass(frozen=True, slots=True)
class ModelDescription:
    """A model as its class presents itself.

    A policy's class may say more about itself through the attributes `known_goals`, `needed_sensors`, `weights_file`
    and `settings_class`; none of them is required.
    """

    name: str
    where: str
    """`module:Class`."""
    summary: str
    keywords: Mapping[str, str]
    """What it is made with: keyword -> default as text; those in `registry.FLAGS` are options of the command line."""
    goals: tuple[str, ...] | None
    """None: any goal, or the class does not say."""
    sensors: tuple[Sensor, ...]
    weights_file: str
    """What its weights are called in the directory of weights; empty when it has none."""
    settings_class: type[BaseModel] | None
    can_check: bool


@dataclass(frozen=True, slots=True)
class Timing:
    """How long one step takes in one engine."""

    engine: str
    median_ms: float
    steps: int


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """What `vsnbench models check` found; a model offers it as the class method `check(weights, settings, device)`."""

    model: str
    weights: Path
    sha256: str
    size_bytes: int
    facts: Mapping[str, str | int | float | bool | None]
    """What is in the weights, in the order to be shown."""
    chosen_engine: str
    parity: Mapping[str, float | int | bool] | None
    """How the chosen engine compares with the reference; None where the reference itself was chosen."""
    timings: tuple[Timing, ...]
    warning: str = ""
    """Why the fastest engine was not chosen."""


def describe_model(name: str) -> ModelDescription:
    """Describe a model by its class.

    Raises:
        UsageError: there is no such model.
        ModelError: its module cannot be imported.
    """
    where, factory = locate(name)
    text = inspect.getdoc(inspect.getmodule(factory)) or inspect.getdoc(factory) or ""
    goals = getattr(factory, "known_goals", None)
    return ModelDescription(
        name=name,
        where=where,
        summary=text.partition("\n")[0].removeprefix(f"The model `{name}`: ").removesuffix("."),
        keywords=keywords_of(factory),
        goals=None if goals is None else tuple(goals),
        sensors=tuple(getattr(factory, "needed_sensors", ())),
        weights_file=str(getattr(factory, "weights_file", "")),
        settings_class=getattr(factory, "settings_class", None),
        can_check=callable(getattr(factory, "check", None)),
    )
