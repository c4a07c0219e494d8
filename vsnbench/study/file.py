"""The study file `study.yaml`: models, trials, order, analysis and stopping rule, fixed before the first trial."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, field_validator, model_validator

from vsnbench.errors import StudyError
from vsnbench.files.regular import open_regular
from vsnbench.protocol.named import NAMED
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.settings.yaml_file import parse_settings
from vsnbench.sites.categories import CATEGORIES, canonical_category
from vsnbench.statistics.sequential.group_sequential import SPENDING

MAX_ARMS = 12
_GOAL = re.compile(r"[a-z0-9][a-z0-9_-]{0,79}")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")


def _goal_name(word: str) -> str:
    """Return the name of a goal: another name of a category is replaced. Whether the site has it is checked with it."""
    name = canonical_category(word) if canonical_category(word) in CATEGORIES else word.strip()
    if not _GOAL.fullmatch(name):
        raise ValueError(f"unknown goal {word!r}: name a category or the id of a goal of the site file")
    return name


class Arm(BaseModel):
    """A model of the comparison, with the options of `vsnbench run`."""

    model_config = ConfigDict(frozen=True, extra="forbid", protected_namespaces=())

    model: str = Field(min_length=1, description="value of --model: pirlnav, package.module:Class, ws://host:port")
    weights: str | None = Field(default=None, description="file of its weights, or `embedded`")
    model_settings: str | None = Field(default=None, alias="config", description="YAML file of its settings")
    device: str | None = Field(default=None, description="auto, cpu, cuda or mps")
    act_timeout: float | None = Field(default=None, ge=0.1, le=600, description="seconds to wait for an action")
    goals: tuple[str, ...] = Field(default=(), description="additional goals of this arm only")

    @field_validator("goals", mode="after")
    @classmethod
    def _named_goals(cls, goals: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_goal_name(goal) for goal in goals)

    @property
    def options(self) -> dict[str, Any]:
        """Options of the model; paths as written in the file."""
        given: dict[str, Any] = {
            "weights": Path(self.weights) if self.weights else None,
            "model_config": Path(self.model_settings) if self.model_settings else None,
            "device": self.device,
        }
        return {name: value for name, value in given.items() if value is not None}


class Difference(BaseModel):
    """Difference in success or progress between all pairs of arms on the shared goals."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["difference"] = Field(default="difference", description="paired difference, shared goals")
    metric: Literal["success", "progress"] = Field(
        default="success", description="success, or progress: covered share of the shortest path to the goal"
    )


class Rate(BaseModel):
    """Success of one arm against a fixed rate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["rate"] = Field(description="success of one arm against a fixed rate, shared goals")
    arm: str = Field(description="name of the arm")
    rate: float = Field(gt=0, lt=1, description="reference rate, 0 to 1")


class Equivalence(BaseModel):
    """All pairs of arms are equally good up to the margin, on the shared goals."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["equivalence"] = Field(description="all pairs are equally good up to `margin`, shared goals")
    metric: Literal["success", "progress"] = Field(default="success", description="success or progress")


class NonInferiority(BaseModel):
    """One arm is worse than each other arm by less than the margin, if at all."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["non-inferiority"] = Field(description="one arm is at most `margin` worse than each other one")
    arm: str = Field(description="name of the arm that must not be inferior")
    metric: Literal["success", "progress"] = Field(default="success", description="success or progress")


Primary = Annotated[Difference | Rate | Equivalence | NonInferiority, Field(discriminator="kind")]


class StudyFile(BaseModel):
    """Plan of a study."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1, max_length=200, description="title; shown to operators, so without model names")
    question: str = Field(min_length=1, max_length=1000, description="question that the study answers")
    site: str = Field(default="apartment", description="embedded site, or path of a site file")
    robot: str = Field(default="simulated", description="value of --robot")
    noise: bool = Field(default=False, description="noisy depth and odometry in simulation")
    rehearse: bool = Field(
        default=False,
        validation_alias=AliasChoices("rehearse", "pretend_real"),  # the second one is in earlier studies
        description="a rehearsal: a simulated robot that the operator places and judges",
    )
    arms: dict[str, Arm] = Field(description="name -> model; two to twelve")
    goals: tuple[str, ...] = Field(
        min_length=1, description="shared goals, which are compared: categories, or ids of goals of the site file"
    )
    starting_positions: str | None = Field(default=None, description="such as 1-15,20; default: all of the site")
    repetitions: int = Field(default=1, ge=1, le=1000, description="trials of each arm per goal and starting position")
    real_cells: int | None = Field(
        default=None,
        ge=6,
        le=100_000,
        description="number of cells (goal and starting position) that are drawn at random for real trials; simulated "
        "trials of all cells, run before, predict the others (a planned twin)",
    )
    protocol: ProtocolParameters = Field(
        default_factory=ProtocolParameters, description="name of a protocol, or its parameters"
    )
    order: Literal["blocks", "shuffled", "as-planned"] = Field(
        default="blocks",
        description="blocks: every arm once on one cell, arms and blocks in random order; shuffled; as-planned: arm by "
        "arm",
    )
    seed: int = Field(default=0, ge=0, le=2**63 - 1, description="seed of schedule, codes and trials")
    blind: bool = Field(default=True, description="show codes instead of names until the study is unblinded")
    stopping: Literal["plan", "decided"] = Field(
        default="plan", description="plan: when all trials are complete; decided: when the primary analysis is decided"
    )
    test: Literal["sign-flips", "bets"] | None = Field(
        default=None,
        description="rule of `decided`: sign-flips (at the looks, the default) or bets (after every unit of `about`)",
    )
    looks: tuple[int, ...] | None = Field(
        default=None,
        description="numbers of complete starting positions at which `decided` is analysed; default: about half, three "
        "quarters and all of them",
    )
    spending: float = Field(
        default=SPENDING,
        ge=0.5,
        le=10,
        description="exponent of alpha spending: up to a look at the share t of the positions, alpha * t**spending",
    )
    about: Literal["these-cells", "cells-like-these"] | None = Field(
        default=None,
        description="scope of bets: these-cells (evaluated per block) or cells-like-these (evaluated per starting "
        "position)",
    )
    primary: Primary = Field(default_factory=Difference, description="analysis that determines the conclusion")
    alpha: float = Field(default=0.05, gt=0, lt=0.5, description="family-wise error rate over all pairs")
    margin: float = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="difference that a winner must exceed; that equivalent arms must not reach",
    )
    difference: float = Field(default=0.15, gt=0, le=1, description="true difference for `vsnbench study plan`")
    power: float = Field(default=0.8, gt=0, lt=1, description="desired power for `vsnbench study plan`")
    operators: tuple[str, ...] = Field(default=(), description="planned operators; others are reported as a deviation")
    notes: str = Field(default="", description="free text")

    @field_validator("protocol", mode="before")
    @classmethod
    def _named_protocol(cls, protocol: object) -> object:
        """Replace a name by its parameters. A path is refused, because the lock covers this file only."""
        if not isinstance(protocol, str):
            return protocol
        if protocol not in NAMED:
            raise ValueError(f"unknown protocol {protocol!r}; known are {', '.join(NAMED)}; write others as parameters")
        return NAMED[protocol].parameters

    @field_validator("primary", mode="before")
    @classmethod
    def _difference_by_default(cls, primary: object) -> object:
        return {"kind": "difference", **primary} if isinstance(primary, dict) else primary

    @field_validator("arms")
    @classmethod
    def _enough_arms(cls, arms: dict[str, Arm]) -> dict[str, Arm]:
        if len(arms) < 2:
            raise ValueError("a study compares at least two models: use `vsnbench run` for one")
        if len(arms) > MAX_ARMS:
            raise ValueError(f"{len(arms)} arms: a study can have at most {MAX_ARMS}")
        for name in arms:
            if not _NAME.fullmatch(name):
                raise ValueError(f"invalid name of an arm: {name!r}; use letters, digits, `-`, `_` and `.`")
        seen: dict[str, str] = {}
        for name, arm in arms.items():
            other = seen.setdefault(arm.model_copy(update={"goals": ()}).model_dump_json(), name)
            if other != name:
                raise ValueError(f"arms {other} and {name} are the same model with the same settings: remove one")
        return arms

    @field_validator("goals", mode="after")
    @classmethod
    def _named_goals(cls, goals: tuple[str, ...]) -> tuple[str, ...]:
        goals = tuple(_goal_name(goal) for goal in goals)
        if len(set(goals)) != len(goals):
            raise ValueError("a goal is listed twice")
        return goals

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for name, arm in self.arms.items():
            for goal in arm.goals:
                if goal in self.goals:
                    raise ValueError(f"arm {name}: {goal} is already a shared goal")
        if isinstance(self.primary, Rate | NonInferiority) and self.primary.arm not in self.arms:
            raise ValueError(f"primary: unknown arm {self.primary.arm}; known are {', '.join(self.arms)}")
        if self.stopping == "decided" and self.order != "blocks":
            raise ValueError("stopping: decided requires order: blocks, because it relies on their random order")
        if self.stopping == "plan" and (self.about, self.test, self.looks) != (None, None, None):
            raise ValueError("about, test and looks require stopping: decided; a whole plan is analysed once")
        if self.test == "bets" and self.about is None:
            raise ValueError("test: bets requires about: these-cells or cells-like-these")
        if self.test == "sign-flips" and self.about is not None:
            raise ValueError("about: requires test: bets; sign flips are always about cells like these")
        if self.looks is not None:
            if self.about is not None:
                raise ValueError("looks: require test: sign-flips; bets are evaluated after every unit")
            if not self.looks or min(self.looks) < 2 or list(self.looks) != sorted(set(self.looks)):
                raise ValueError("looks: must be increasing numbers of starting positions from 2, such as [8, 11, 15]")
        if self.real_cells is not None and (self.primary.kind, self.stopping) != ("rate", "plan"):
            raise ValueError("real_cells: requires primary: {kind: rate} and stopping: plan; a twin predicts one rate")
        if self.of_margin and not self.margin:
            raise ValueError(
                f"margin: must be above 0 for primary: {self.primary.kind}; give the largest difference that does not "
                "matter, such as 0.15"
            )
        if self.of_margin and self.about is not None:
            raise ValueError(f"primary: {self.primary.kind} requires test: sign-flips or stopping: plan")
        return self

    @property
    def of_these_cells(self) -> bool:
        """Whether the conclusion is about the plan's own cells only."""
        return self.stopping == "decided" and self.about == "these-cells"

    @property
    def by_starting_position(self) -> bool:
        """Whether the study is evaluated while it runs, by whole starting positions, and generalizes to others."""
        return self.stopping == "decided" and not self.of_these_cells

    @property
    def by_looks(self) -> bool:
        """Whether the study is analysed at planned looks by sign flips.

        Plans with `about` and without `test` are of versions that had only bets; they keep their rule.
        """
        return self.stopping == "decided" and self.about is None

    @property
    def of_progress(self) -> bool:
        """Whether the primary analysis compares progress instead of success."""
        return not isinstance(self.primary, Rate) and self.primary.metric == "progress"

    @property
    def of_margin(self) -> bool:
        """Whether the primary analysis asks if arms are equally good up to the margin, instead of which is better."""
        return isinstance(self.primary, Equivalence | NonInferiority)

    def goals_of(self, arm: str) -> tuple[str, ...]:
        """Return all goals of an arm, shared ones first."""
        return (*self.goals, *self.arms[arm].goals)


MAX_BYTES = 1_000_000


def read_text(path: Path) -> str:
    """Return the text of a study file.

    Raises:
        StudyError: the file cannot be read or is not text.
    """
    try:
        with open_regular(path) as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as problem:
        hint = ": `vsnbench study new` writes one" if isinstance(problem, FileNotFoundError) else ""
        raise StudyError(f"cannot read study file {path}: {problem.strerror or problem}{hint}") from problem
    if len(content) > MAX_BYTES:
        raise StudyError(f"study file {path} is longer than {MAX_BYTES:,} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise StudyError(f"cannot read study file {path}: it is not UTF-8 text") from problem


def parse_study(text: str, origin: str) -> StudyFile:
    """Read a study from the text of its file.

    Raises:
        StudyError: the format is invalid; the message names the line and the field.
    """
    return parse_settings(text, origin, StudyFile, StudyError, "study")
