"""Conditions of a report, with short unique names and a footnote for each."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from vsnbench.protocol.disturbances import DISTURBANCES, EDITION, text_of_conditions
from vsnbench.protocol.execution import STACK, STOP_AND_GO, execution_of, text_of_execution, time_limit_s
from vsnbench.protocol.parameters import PAPER_PROTOCOL
from vsnbench.values.model.person import driver_of_model
from vsnbench.values.movement import ActionKind
from vsnbench.values.robot_identity import REHEARSAL_KEY

_NAMED_ABOVE = ("name", "max_actions", "max_time_s", "max_path_m", "success_distance_m", "execution")
"""Parameters of the protocol with a facet of their own."""
_CONDITIONS_ABOVE = (DISTURBANCES, EDITION, REHEARSAL_KEY)
_SIMULATOR = "robot simulator"
_LONGEST_VALUE = 24
"""Maximum length of a setting's value in a name."""
_DISCRETE = (ActionKind.DISCRETE.value,)


@dataclass(frozen=True, slots=True)
class Selection:
    """Part of the record that a report covers; empty fields select everything."""

    models: Sequence[str] = ()
    goals: Sequence[str] = ()
    sites: Sequence[str] = ()
    robots: Sequence[str] = ()
    campaigns: Sequence[int] = ()


@dataclass(frozen=True, slots=True)
class Condition:
    """One model on one robot in one site under one protocol; only equal conditions are pooled."""

    number: int
    """From 1, in the order of the first campaign."""
    model: str
    weights_label: str
    weights_sha256: str
    surveyed: bool
    """The model has access to the site file: an upper bound, not a competitor."""
    robot: str
    robot_title: str
    kind: str
    """Kind of robot: `simulated`, `ros1`, a plug-in's class, or `imported`."""
    simulated: bool
    site: str
    site_sha256: str
    campaigns: tuple[int, ...]
    seeds: tuple[int, ...] = ()
    """Seeds of the campaigns, in the same order."""
    protocol: Mapping[str, Any] = field(default_factory=dict)
    """Recorded protocol parameters."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Recorded settings of the model."""
    source: Mapping[str, Any] = field(default_factory=dict)
    """Class and source hash of a user's model."""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    """Recorded conditions of the robot: `noise` of simulated sensors and odometry, filters, lag."""
    name: str = ""
    """Label in tables and figures: the model's name, with the fewest settings that make it unique in the report."""
    differing: tuple[str, ...] = ()
    """Settings that differ from other conditions of the same model, as `name=value`."""
    published: bool = False
    """From the paper instead of the record."""
    max_linear_m_s: float | None = None
    """Greatest speed of the recorded robot's base; None if unknown."""
    survey_sha256: str = ""
    """Hash of the site without its scan; empty for a site without one."""
    blind: bool = False
    """Arm of a blinded study: the model is a code, and identifying data are missing."""

    @property
    def environment(self) -> str:
        """`simulated` or `real`."""
        return "simulated" if self.simulated else "real"

    @property
    def places_sha256(self) -> str:
        """Hash of what goals and starting positions depend on: the site without its scan."""
        return self.survey_sha256 or self.site_sha256

    @property
    def twin(self) -> str:
        """What a simulated robot saw: `the scan` or `the drawn twin`; empty for a real one."""
        return ("the scan" if self.survey_sha256 else "the drawn twin") if self.simulated else ""

    @property
    def noisy(self) -> bool:
        """Whether sensors and odometry are noisy."""
        return bool(self.conditions.get("noise"))

    @property
    def disturbed(self) -> str:
        """Disturbances of what the model sees, as on the command line; empty without any."""
        return text_of_conditions(self.conditions)

    @property
    def driver(self) -> str:
        """Name of the person who drove; empty for a model."""
        return driver_of_model(self.model, self.settings)

    @property
    def label(self) -> str:
        """The model, with the name of the driver for a person."""
        return f"{self.model} {self.driver}" if self.driver else self.model

    @property
    def not_competing(self) -> str:
        """Why it is shown for reference, and neither ranked nor compared with the models; empty for a competitor."""
        if self.driver:
            return "a person: a reference, not a competitor"
        return "the model has access to the site file: an upper bound, not a competitor" if self.surveyed else ""

    @property
    def action_kinds(self) -> tuple[str, ...]:
        """Kinds of the model's answers. Numbers of actions of different kinds are not comparable."""
        kinds = self.settings.get("action_kinds")
        if not isinstance(kinds, Sequence) or isinstance(kinds, str):
            return _DISCRETE
        return tuple(sorted(map(str, kinds)))

    @property
    def execution(self) -> str:
        """`stop_and_go`, `continuous` or `stack`; only equal ones compare numbers of actions."""
        return execution_of(self.protocol)

    @property
    def max_actions(self) -> int | None:
        """Maximum number of actions; None if the protocol has none, or the robot does not rest between them."""
        return self.protocol.get("max_actions") if self.execution == STOP_AND_GO else None

    @property
    def protocol_name(self) -> str:
        """Name of the protocol; empty if none is recorded, as for published results."""
        return str(self.protocol.get("name", PAPER_PROTOCOL if "depth_guard" in self.protocol else ""))

    @property
    def max_time_s(self) -> float | None:
        """Maximum time on the robot's clock; None for no limit."""
        limits = self.protocol.get("max_time_s"), self.protocol.get("max_actions")
        return time_limit_s(*limits, drives_on=self.execution != STOP_AND_GO)

    @property
    def max_path_m(self) -> float | None:
        """Maximum length of the path; None for no limit."""
        return self.protocol.get("max_path_m")

    @property
    def success_distance_m(self) -> float | None:
        """Distance to the goal below which STOP is a success; None if the protocol has none."""
        return self.protocol.get("success_distance_m")

    @property
    def description(self) -> str:
        """Footnote to the name: robot, site, protocol and differing settings."""
        weights = f" ({self.weights_sha256[:8]})" if self.weights_sha256 else ""
        label = "" if self.execution == STACK or self.driver else "weights: "
        parts = [
            f"{self.robot_title or self.robot}, {self.environment}",
            f"site {self.site}",
            f"images of {self.twin}" if self.simulated and self.survey_sha256 else "",
            f"protocol {self.protocol_name}" if self.protocol_name not in ("", PAPER_PROTOCOL) else "",
            text_of_execution(self.protocol) if self.execution != STOP_AND_GO else "",
            f"at most {self.max_actions} actions" if self.max_actions else "",
            f"at most {self.max_time_s:g} s" if self.max_time_s is not None else "",
            f"at most {self.max_path_m:g} m of path" if self.max_path_m is not None else "",
            f"success under {self.success_distance_m:g} m" if self.success_distance_m is not None else "",
            f"answers: {', '.join(self.action_kinds)}" if self.action_kinds != _DISCRETE else "",
            "sensor noise on" if self.noisy else "",
            f"disturbed: {self.disturbed}" if self.disturbed else "",
            f"{label}{self.weights_label}{weights}" if self.weights_label else "",
            f"campaign {', '.join(map(str, self.campaigns))}" if self.name.endswith(f"#{self.number}") else "",
            ", ".join(self.differing),
            self.not_competing,
        ]
        return "; ".join(part for part in parts if part) + "."


def footnotes(conditions: Sequence[Condition]) -> tuple[str, ...]:
    """Return one footnote per condition that explains its name."""
    return tuple(f"{condition.name}: {condition.description}" for condition in conditions)


def name_apart(conditions: Sequence[Condition]) -> tuple[Condition, ...]:
    """Give each condition a unique name with as few settings as possible.

    A model with one condition keeps its name. With several conditions none has the bare name, so that a command that
    uses it asks for the exact condition. A footnote names the simulator if another model was tried in another version.
    """
    names, differing = dict[int, str](), dict[int, tuple[str, ...]]()
    all_facets = [dict(_facets(condition)) for condition in conditions]
    for model in dict.fromkeys(condition.label for condition in conditions):
        places = [place for place, condition in enumerate(conditions) if condition.label == model]
        facets = [all_facets[place] for place in places]
        # A hash of the code appears only in the footnote.
        readable = [{facet: text for facet, text in own.items() if facet != "model code"} for own in facets]
        distinguishing = _distinguishing(readable)
        for place, own in zip(places, facets, strict=True):
            words = ", ".join(own[facet] for facet in distinguishing if facet in own)
            names[place] = f"{model} {words}" if words else model
            apart = [
                word
                for facet, word in own.items()
                # For noise settings that the others do not have, `sensor noise on` is sufficient.
                if "=" in word
                and facet != "disturbances"
                and any(_differs(facet, word, other) for other in (all_facets if facet == _SIMULATOR else facets))
            ]
            differing[place] = tuple(word for word in apart if not _is_repeated(word, apart))
    taken = list(names.values())
    for place, member in enumerate(conditions):
        clashes = taken.count(names[place]) > 1
        bare = names[place] == member.label and [other.label for other in conditions].count(member.label) > 1
        if clashes or bare:
            names[place] = f"{names[place]} #{member.number}"
    return tuple(
        replace(condition, name=names[place], differing=differing[place]) for place, condition in enumerate(conditions)
    )


def _is_repeated(word: str, others: Sequence[str]) -> bool:
    """Whether a nested setting repeats a top-level one that the model passes on under the same name."""
    path, _, value = word.partition("=")
    return "." in path and f"{path.rpartition('.')[2]}={value}" in others


def _differs(facet: str, word: str, other: Mapping[str, str]) -> bool:
    return word != other.get(facet) and (facet in other or not facet.startswith(("robot noise.", _SIMULATOR)))


def _distinguishing(facets: Sequence[Mapping[str, str]]) -> list[str]:
    """Return a small set of facets that distinguishes the conditions, chosen greedily by number of groups."""
    known = list(dict.fromkeys(facet for own in facets for facet in own))
    chosen: list[str] = []

    def kinds(of: Sequence[str]) -> int:
        return len({tuple(own.get(facet) for facet in of) for own in facets})

    while kinds(chosen) < len(facets):
        best = max(known, key=lambda facet: kinds([*chosen, facet]), default=None)
        if best is None or kinds([*chosen, best]) == kinds(chosen):
            break  # the remaining conditions are distinguished by their numbers
        chosen.append(best)
    needed = [facet for facet in chosen if kinds([other for other in chosen if other != facet]) < kinds(chosen)]
    return sorted(needed if kinds(needed) == kinds(chosen) else chosen, key=known.index)


def _facets(condition: Condition) -> Iterator[tuple[str, str]]:
    """Yield the facets that can distinguish conditions of a model, with their texts, most important first."""
    yield "environment", condition.environment
    yield "robot", f"on {condition.robot}"
    yield "site", f"in {condition.site}"
    yield "twin", f"in {condition.twin}" if condition.twin else condition.environment
    yield "site content", f"in {condition.site} {condition.site_sha256[:8]}"
    yield "noise", "with noise" if condition.noisy else "without noise"
    yield "disturbances", f"with {condition.disturbed}" if condition.disturbed else "undisturbed"
    yield "execution", text_of_execution(condition.protocol)
    yield "rehearsal", "in rehearsal" if condition.conditions.get(REHEARSAL_KEY) else "not in rehearsal"
    if condition.protocol_name:
        yield "protocol", f"under {condition.protocol_name}"
    if condition.max_actions is not None:
        yield "cap", f"within {condition.max_actions} actions"
    if condition.max_time_s is not None:
        yield "time limit", f"within {condition.max_time_s:g} s"
    if condition.max_path_m is not None:
        yield "path limit", f"within {condition.max_path_m:g} m of path"
    if condition.success_distance_m is not None:
        yield "success distance", f"under {condition.success_distance_m:g} m"
    yield "weights", f"weights {condition.weights_sha256[:8]}" if condition.weights_sha256 else "no weights"
    protocol = {name: value for name, value in condition.protocol.items() if name not in _NAMED_ABOVE}
    conditions = {name: value for name, value in condition.conditions.items() if name not in _CONDITIONS_ABOVE}
    for kind, settings in (("model", condition.settings), ("protocol", protocol), ("robot", conditions)):
        for name, value in _flat(settings):
            yield f"{kind} {name}", f"{name}={value}"
    if code := condition.source.get("sha256"):
        yield "model code", f"code={code[:8]}"
    yield "kind", f"through {condition.kind}"


def _flat(settings: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
    """Yield every setting with its dotted path; nested settings come last."""
    for name, value in settings.items():
        if not isinstance(value, Mapping):
            yield f"{within}{name}", _short(f"{value:g}" if isinstance(value, float) else str(value))
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{within}{name}.")


def _short(value: str) -> str:
    """Return a setting's value; long values are shortened to their beginning and a hash."""
    if len(value) <= _LONGEST_VALUE:
        return value
    return f"{value[: _LONGEST_VALUE - 9]}…{hashlib.sha256(value.encode()).hexdigest()[:8]}"
