"""What was tested: conditions, under names as short as tell them apart, each with a footnote that says the rest."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, select

from vsnbench.database.blinding import CODE, MODEL_NAME
from vsnbench.database.engine import to_json
from vsnbench.database.tables import Campaign, Model, Robot, Site

if TYPE_CHECKING:
    from vsnbench.report.record import Selection

_LONGEST_VALUE = 24
"""Characters of a setting's value in a name."""


@dataclass(frozen=True, slots=True)
class Condition:
    """What was tested: one model on one robot in one site under one protocol; only like is pooled with like."""

    number: int
    """From 1, in the order of the first campaign."""
    model: str
    weights_label: str
    weights_sha256: str
    surveyed: bool
    """The model is handed the site: an upper bound, not a competitor."""
    robot: str
    robot_title: str
    kind: str
    """Of the robot: `simulated`, `ros1`, a plug-in's class, or `imported`."""
    simulated: bool
    site: str
    site_sha256: str
    campaigns: tuple[int, ...]
    seeds: tuple[int, ...] = ()
    """Of the campaigns, in their order."""
    protocol: Mapping[str, Any] = field(default_factory=dict)
    """The parameters it was run under, as recorded."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Of the model, as recorded."""
    source: Mapping[str, Any] = field(default_factory=dict)
    """Of a model of one's own: its class and the hash of its source."""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    """What else results depend on, as the robot said: `noise` of the simulated sensors and odometry, filters, lag."""
    name: str = ""
    """The model's name, made unique among the conditions of a report by as little as tells them apart: the label in
    every table and figure."""
    differing: tuple[str, ...] = ()
    """Every setting in which it differs from another condition of the same model, as `name=value`."""
    published: bool = False
    """Printed in the paper, not measured here."""
    blind: bool = False
    """An arm of a study that is blind: its model is a code, and what would tell which it is is not there."""

    @property
    def environment(self) -> str:
        """`simulated` or `real`."""
        return "simulated" if self.simulated else "real"

    @property
    def noisy(self) -> bool:
        """Whether sensors and odometry were given noise."""
        return bool(self.conditions.get("noise"))

    @property
    def max_actions(self) -> int | None:
        """The cap on actions; None where the protocol says none."""
        return self.protocol.get("max_actions")

    @property
    def success_distance_m(self) -> float | None:
        """Below this distance to the goal STOP is a success; None where the protocol says none."""
        return self.protocol.get("success_distance_m")

    @property
    def description(self) -> str:
        """What was tested, and how, in one line: the footnote to the name."""
        weights = f" ({self.weights_sha256[:8]})" if self.weights_sha256 else ""
        words = [
            f"{self.robot_title or self.robot}, {self.environment}",
            f"site {self.site}",
            f"at most {self.max_actions} actions" if self.max_actions is not None else "",
            f"success under {self.success_distance_m:g} m" if self.success_distance_m is not None else "",
            "sensor noise on" if self.noisy else "",
            f"weights: {self.weights_label}{weights}" if self.weights_label else "",
            f"campaign {', '.join(map(str, self.campaigns))}" if self.name.endswith(f"#{self.number}") else "",
            ", ".join(self.differing),
            "the model is handed the site: an upper bound, not a competitor" if self.surveyed else "",
        ]
        return "; ".join(each for each in words if each) + "."


def footnotes(conditions: Sequence[Condition]) -> tuple[str, ...]:
    """Return a line a condition that says what its name stands for."""
    return tuple(f"{one.name}: {one.description}" for one in conditions)


def read_conditions(connection: Connection, chosen: "Selection") -> tuple[tuple[Condition, ...], dict[int, int]]:
    """Return the conditions and campaign id -> number of its condition."""
    rows = connection.execute(
        select(Campaign.id, Campaign.protocol, Campaign.protocol_sha256, Campaign.conditions, Campaign.seed)
        .add_columns(Model.id.label("model_id"), MODEL_NAME.label("model"), Model.weights_label, Model.weights_sha256)
        .add_columns(Model.surveyed, Model.settings, Model.code.label("source"), CODE.label("code"))
        .add_columns(Robot.id.label("robot_id"), Robot.name.label("robot"), Robot.title, Robot.kind, Robot.simulated)
        .add_columns(Site.name.label("site"), Site.sha256.label("site_sha256"))
        .join(Model, Model.id == Campaign.model_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .join(Site, Site.id == Campaign.site_id)
        .where(*_campaign_filter(chosen))
        .order_by(Campaign.id)
    ).all()
    groups: dict[tuple[object, ...], list[Any]] = {}
    for row in rows:
        # An arm of a blind study is pooled with nothing: whatever it was pooled with would name it.
        who = row.code or row.model_id
        key = (who, row.robot_id, row.site_sha256, row.protocol_sha256, to_json(row.conditions, in_order=True))
        groups.setdefault(key, []).append(row)
    conditions = []
    condition_of: dict[int, int] = {}
    for number, members in enumerate(groups.values(), start=1):
        first = members[0]
        condition_of |= {row.id: number for row in members}
        conditions.append(
            Condition(
                number=number,
                model=first.model,
                weights_label="" if first.code else first.weights_label,
                weights_sha256="" if first.code else first.weights_sha256,
                surveyed=first.surveyed and not first.code,
                robot=first.robot,
                robot_title=first.title,
                kind=first.kind,
                simulated=first.simulated,
                site=first.site,
                site_sha256=first.site_sha256,
                campaigns=tuple(row.id for row in members),
                seeds=tuple(row.seed for row in members),
                protocol=first.protocol or {},
                settings={} if first.code else first.settings or {},
                source={} if first.code else first.source or {},
                conditions=first.conditions or {},
                blind=bool(first.code),
            )
        )
    return name_apart(conditions), condition_of


def _campaign_filter(chosen: "Selection") -> list[Any]:
    wanted: list[Any] = []
    if chosen.models:
        wanted.append(MODEL_NAME.in_(chosen.models))
    if chosen.sites:
        wanted.append(Site.name.in_(chosen.sites))
    if chosen.robots:
        wanted.append(Robot.name.in_(chosen.robots))
    if chosen.campaigns:
        wanted.append(Campaign.id.in_(chosen.campaigns))
    return wanted


def name_apart(conditions: Sequence[Condition]) -> tuple[Condition, ...]:
    """Give each condition a name that no other has, from as little as tells them apart.

    A model that was tested once keeps its name; of one that was tested several times no condition has the bare name,
    so that whoever types it is asked which is meant.
    """
    names: dict[int, str] = {}
    differing: dict[int, tuple[str, ...]] = {}
    for model in dict.fromkeys(one.model for one in conditions):
        twins = [place for place, one in enumerate(conditions) if one.model == model]
        facets = [dict(_facets(conditions[place])) for place in twins]
        readable = [{facet: word for facet, word in own.items() if not _is_code(facet)} for own in facets]
        telling = _telling(readable)
        for place, own in zip(twins, facets, strict=True):
            words = ", ".join(own[facet] for facet in telling if facet in own)
            names[place] = f"{model} {words}" if words else model
            apart = [
                word
                for facet, word in own.items()
                # Of noise that others have none of, `sensor noise on` says it.
                if "=" in word and any(_differs(facet, word, other) for other in facets)
            ]
            differing[place] = tuple(word for word in apart if not _said_by_another(word, apart))
    taken = list(names.values())
    for place, one in enumerate(conditions):
        clashes = taken.count(names[place]) > 1
        bare = names[place] == one.model and [other.model for other in conditions].count(one.model) > 1
        if clashes or bare:
            names[place] = f"{names[place]} #{one.number}"
    return tuple(replace(one, name=names[place], differing=differing[place]) for place, one in enumerate(conditions))


def _said_by_another(word: str, others: Sequence[str]) -> bool:
    """Whether a setting within another one repeats one that is not: a model hands it on under the same name."""
    path, _, value = word.partition("=")
    return "." in path and f"{path.rpartition('.')[2]}={value}" in others


def _is_code(facet: str) -> bool:
    """Whether it is a hash of code: no name, but a word of the footnote; a number tells such conditions apart."""
    return facet.startswith("model code")


def _differs(facet: str, word: str, other: Mapping[str, str]) -> bool:
    return word != other.get(facet) and (facet in other or not facet.startswith("robot noise."))


def _telling(facets: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the facets that tell these apart: each the one that splits them most, the first of those that tie."""
    known = list(dict.fromkeys(facet for own in facets for facet in own))
    chosen: list[str] = []

    def kinds(of: Sequence[str]) -> int:
        return len({tuple(own.get(facet) for facet in of) for own in facets})

    while kinds(chosen) < len(facets):
        best = max(known, key=lambda facet: kinds([*chosen, facet]), default=None)
        if best is None or kinds([*chosen, best]) == kinds(chosen):
            break  # nothing that is known tells the rest apart: their numbers do
        chosen.append(best)
    needed = [facet for facet in chosen if kinds([other for other in chosen if other != facet]) < kinds(chosen)]
    return sorted(needed if kinds(needed) == kinds(chosen) else chosen, key=known.index)


def _facets(condition: Condition) -> Iterator[tuple[str, str]]:
    """Yield what may tell a condition from others of its model, with the words for it, the most telling first."""
    yield "environment", condition.environment
    yield "robot", f"on {condition.robot}"
    yield "site", f"in {condition.site}"
    yield "site content", f"in {condition.site} {condition.site_sha256[:8]}"
    yield "noise", "with noise" if condition.noisy else "without noise"
    if condition.max_actions is not None:
        yield "cap", f"within {condition.max_actions} actions"
    if condition.success_distance_m is not None:
        yield "success distance", f"under {condition.success_distance_m:g} m"
    yield "weights", f"weights {condition.weights_sha256[:8]}" if condition.weights_sha256 else "no weights"
    protocol = {
        name: each for name, each in condition.protocol.items() if name not in ("max_actions", "success_distance_m")
    }
    for kind, settings in (("model", condition.settings), ("protocol", protocol), ("robot", condition.conditions)):
        for name, value in _flat(settings):
            yield f"{kind} {name}", f"{name}={value}"
    if code := condition.source.get("sha256"):
        yield "model code", f"code={code[:8]}"
    yield "kind", f"through {condition.kind}"


def _flat(settings: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
    """Yield every single setting by its path; those within others after those that are not."""
    for name, value in settings.items():
        if not isinstance(value, Mapping):
            yield f"{within}{name}", _short(f"{value:g}" if isinstance(value, float) else str(value))
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{within}{name}.")


def _short(value: str) -> str:
    """Return a value of a setting as it is, or its beginning and a hash, so that two long ones stay apart."""
    if len(value) <= _LONGEST_VALUE:
        return value
    return f"{value[: _LONGEST_VALUE - 9]}…{hashlib.sha256(value.encode()).hexdigest()[:8]}"
