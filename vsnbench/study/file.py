"""`study.yaml`: what is compared, on what, in which order, judged how; everything is said before the first trial."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from vsnbench.errors import StudyError
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.settings_file import parse_settings

MOST_ARMS = 12
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")


class Arm(BaseModel):
    """One of the models that are compared, as `vsnbench run` takes it."""

    model_config = ConfigDict(frozen=True, extra="forbid", protected_namespaces=())

    model: str = Field(min_length=1, description="what --model takes: pirlnav, package.module:Class, ws://host:port")
    weights: str | None = Field(default=None, description="file of its weights, or `embedded`")
    model_settings: str | None = Field(default=None, alias="config", description="YAML file of its settings")
    device: str | None = Field(default=None, description="auto, cpu, cuda or mps")
    act_timeout: float | None = Field(default=None, ge=0.1, le=600, description="seconds an action may take to choose")
    goals: tuple[str, ...] = Field(default=(), description="goals of this arm alone, beside the shared ones")

    @property
    def elsewhere(self) -> bool:
        """It is served by another process."""
        return self.model.startswith(("ws://", "wss://"))

    @property
    def options(self) -> dict[str, Any]:
        """What the model is made with; paths as they are written in the file."""
        given: dict[str, Any] = {
            "weights": Path(self.weights) if self.weights else None,
            "model_config": Path(self.model_settings) if self.model_settings else None,
            "device": self.device,
            "act_timeout": self.act_timeout if self.elsewhere else None,
        }
        return {name: value for name, value in given.items() if value is not None}


class Difference(BaseModel):
    """Which of the arms succeeds more often on the shared goals: every pair, cell by cell."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["difference"] = Field(default="difference", description="paired difference of success, shared goals")


class Rate(BaseModel):
    """Whether one arm succeeds more, or less, often than a rate that is fixed beforehand."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["rate"] = Field(description="success of one arm against a fixed rate, shared goals")
    arm: str = Field(description="name of the arm")
    rate: float = Field(gt=0, lt=1, description="the rate to be above or below of, 0 to 1")


Primary = Annotated[Difference | Rate, Field(discriminator="kind")]


class StudyFile(BaseModel):
    """A study, as it is written down before the first trial."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1, max_length=200, description="a line; operators see it, so name no model in it")
    question: str = Field(min_length=1, max_length=1000, description="what the study is to answer")
    site: str = Field(default="apartment", description="an embedded site, or the path of a site file")
    robot: str = Field(default="simulated", description="what --robot takes")
    noise: bool = Field(default=False, description="noisy depth and odometry, in simulation")
    pretend_real: bool = Field(
        default=False, description="a rehearsal: a simulated robot that a person must place and judge"
    )
    arms: dict[str, Arm] = Field(description="name -> model; two to twelve")
    goals: tuple[str, ...] = Field(min_length=1, description="the shared goals: those that are compared")
    starting_positions: str | None = Field(default=None, description="like 1-15,20; all of the site's when absent")
    repetitions: int = Field(default=1, ge=1, le=1000, description="times each arm meets each goal at each position")
    protocol: ProtocolParameters = Field(default_factory=ProtocolParameters, description="the protocol's parameters")
    order: Literal["blocks", "shuffled", "as-planned"] = Field(
        default="blocks",
        description="blocks: every arm once on one cell, arms and blocks in random order; shuffled; as-planned: arm by "
        "arm",
    )
    seed: int = Field(default=0, ge=0, le=2**63 - 1, description="schedule, codes and trials follow from it")
    blind: bool = Field(default=True, description="people see codes until the study is unblinded")
    stopping: Literal["plan", "decided"] = Field(
        default="plan", description="plan: when every trial is done; decided: as soon as the primary analysis is"
    )
    about: Literal["these-cells", "cells-like-these"] | None = Field(
        default=None,
        description="what `decided` speaks of: these-cells (fewer trials, no word about others) or cells-like-these",
    )
    primary: Primary = Field(default_factory=Difference, description="the analysis that the conclusion rests on")
    alpha: float = Field(default=0.05, gt=0, lt=0.5, description="chance of a false conclusion, all pairs together")
    margin: float = Field(default=0.0, ge=0, lt=1, description="a winner must be better by more than this share")
    difference: float = Field(default=0.15, gt=0, le=1, description="the difference that the lab wants to find")
    power: float = Field(default=0.8, gt=0, lt=1, description="how surely it wants to find it")
    operators: tuple[str, ...] = Field(default=(), description="who runs it; others are reported as a deviation")
    notes: str = Field(default="", description="anything else")

    @field_validator("arms")
    @classmethod
    def _enough_arms(cls, arms: dict[str, Arm]) -> dict[str, Arm]:
        if len(arms) < 2:
            raise ValueError("a study compares two models or more: one alone is `vsnbench run`")
        if len(arms) > MOST_ARMS:
            raise ValueError(f"{len(arms)} arms: at most {MOST_ARMS} can be compared in one study")
        for name in arms:
            if not _NAME.fullmatch(name):
                raise ValueError(f"an arm's name is letters, digits, `-`, `_` and `.`: {name!r} is not")
        seen: dict[str, str] = {}
        for name, arm in arms.items():
            other = seen.setdefault(arm.model_copy(update={"goals": ()}).model_dump_json(), name)
            if other != name:
                raise ValueError(f"arms {other} and {name} are the same model with the same settings: drop one")
        return arms

    @field_validator("goals", mode="after")
    @classmethod
    def _known_goals(cls, goals: tuple[str, ...]) -> tuple[str, ...]:
        for goal in goals:
            if goal not in GOAL_CATEGORIES:
                raise ValueError(f"no goal category {goal!r}; there are {', '.join(GOAL_CATEGORIES)}")
        if len(set(goals)) != len(goals):
            raise ValueError("a goal is named twice")
        return goals

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for name, arm in self.arms.items():
            for goal in arm.goals:
                if goal not in GOAL_CATEGORIES:
                    raise ValueError(f"arm {name}: no goal category {goal!r}; there are {', '.join(GOAL_CATEGORIES)}")
                if goal in self.goals:
                    raise ValueError(f"arm {name}: {goal} is a shared goal already")
        if isinstance(self.primary, Rate) and self.primary.arm not in self.arms:
            raise ValueError(f"primary: there is no arm {self.primary.arm}; there are {', '.join(self.arms)}")
        if self.stopping == "decided" and self.order != "blocks":
            raise ValueError("stopping: decided needs order: blocks, whose random order it rests on")
        if self.stopping == "decided" and self.about is None:
            raise ValueError(
                "stopping: decided needs about: these-cells (the cells of this plan and no others, fewer trials), or "
                "cells-like-these"
            )
        if self.stopping == "plan" and self.about is not None:
            raise ValueError("about: belongs to stopping: decided; the test of a whole plan is about cells like these")
        return self

    @property
    def of_these_cells(self) -> bool:
        """Whether the conclusion is about the plan's own cells alone."""
        return self.stopping == "decided" and self.about == "these-cells"

    def goals_of(self, arm: str) -> tuple[str, ...]:
        """Return every goal of an arm, the shared ones first."""
        return (*self.goals, *self.arms[arm].goals)


MOST_BYTES = 1_000_000


def read_text(path: Path) -> str:
    """Return the file as it is, byte for byte.

    Raises:
        StudyError: it cannot be read, or is no text.
    """
    try:
        content = path.read_bytes()
    except OSError as problem:
        hint = ": `vsnbench study new` writes one" if isinstance(problem, FileNotFoundError) else ""
        raise StudyError(f"cannot read study file {path}: {problem.strerror or problem}{hint}") from problem
    if len(content) > MOST_BYTES:
        raise StudyError(f"study file {path} is longer than {MOST_BYTES:,} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise StudyError(f"cannot read study file {path}: it is no text in UTF-8") from problem


def parse_study(text: str, origin: str) -> StudyFile:
    """Read a study from the text of its file.

    Args:
        text: YAML.
        origin: names the file in errors.

    Raises:
        StudyError: it breaks the format; the message names the line and the field.
    """
    return parse_settings(text, origin, StudyFile, StudyError, "study")
