"""Disturbances of what a policy sees: names, units, severities, and their text on the command line.

`blur=2` is a value in the disturbance's unit, `blur@3` is a severity from 1 to 5, and `blur` is severity 3. Equal
values are the same condition, however they were written.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from vsnbench.errors import UsageError
from vsnbench.protocol.execution import CONTINUOUS
from vsnbench.text.suggestions import closest
from vsnbench.values.observation import Sensor

DISTURBANCES = "disturbances"
"""Condition of a campaign: value by name. A campaign without disturbances does not have it."""
EDITION = "disturbances_edition"
"""Condition of a campaign with disturbances: the edition of their definitions. A change of a definition raises it."""
CURRENT_EDITION = 1

SEVERITIES = (1, 2, 3, 4, 5)
DEFAULT_SEVERITY = 3

_IMAGES = frozenset({Sensor.INSTANCES, *(sensor for sensor in Sensor if sensor.array and sensor.array.is_image)})


@dataclass(frozen=True, slots=True)
class DisturbanceKind:
    """A kind of disturbance: what it changes, its unit and its values at the severities 1 to 5."""

    name: str
    meaning: str
    unit: str
    values: tuple[float, float, float, float, float]
    lowest: float
    highest: float
    sensors: frozenset[Sensor]
    """Sensors that it changes; empty for a disturbance of time only."""
    geometric: bool = False
    """Whether it moves the camera, which only a simulator can render."""
    standard: bool = True
    """Whether it is in the standard set of `vsnbench stress`."""
    whole: bool = False
    """Whether values are whole numbers."""

    def at(self, severity: int) -> "Disturbance":
        """Return the disturbance of a severity from 1 to 5."""
        return Disturbance(self.name, self.values[severity - 1])


KINDS: Mapping[str, DisturbanceKind] = {
    kind.name: kind
    for kind in (
        DisturbanceKind(
            "blur",
            "Gaussian blur of the colour image; standard deviation in pixels of an image 640 pixels wide",
            "px",
            (1.0, 2.0, 4.0, 6.0, 10.0),
            0.1,
            50.0,
            frozenset({Sensor.RGB}),
        ),
        DisturbanceKind(
            "glare",
            "veil of white light around a lamp at a random heading per trial; share of white at its centre",
            "share",
            (0.2, 0.4, 0.6, 0.8, 1.0),
            0.01,
            1.0,
            frozenset({Sensor.RGB}),
        ),
        DisturbanceKind(
            "low_light",
            "share of the light that is missing; the camera's noise does not shrink with it",
            "share",
            (0.5, 0.7, 0.85, 0.93, 0.97),
            0.01,
            0.999,
            frozenset({Sensor.RGB}),
        ),
        DisturbanceKind(
            "depth_holes",
            "share of the depth image without depth, in patches that change with each image",
            "share",
            (0.05, 0.1, 0.2, 0.4, 0.6),
            0.001,
            1.0,
            frozenset({Sensor.DEPTH}),
        ),
        DisturbanceKind(
            "camera_height",
            "camera mounted higher (positive) or lower (negative); the model receives the true mount",
            "m",
            (-0.05, -0.1, -0.2, -0.3, -0.4),
            -2.0,
            2.0,
            _IMAGES,
            geometric=True,
        ),
        DisturbanceKind(
            "camera_tilt",
            "camera tilted up (positive) or down (negative); the model receives the true tilt",
            "deg",
            (-2.0, -5.0, -10.0, -15.0, -20.0),
            -45.0,
            45.0,
            _IMAGES,
            geometric=True,
        ),
        DisturbanceKind(
            "dropped_frames",
            "probability that new images are lost, so that the model sees the last ones again; odometry is new",
            "share",
            (0.05, 0.1, 0.2, 0.4, 0.6),
            0.001,
            0.99,
            _IMAGES,
        ),
        DisturbanceKind(
            "odometry_drift",
            "standard deviation of odometry's scale errors, drawn per trial, and of its heading's walk, rad/sqrt(m)",
            "share",
            (0.005, 0.01, 0.02, 0.05, 0.1),
            0.0001,
            0.5,
            frozenset({Sensor.ODOMETRY}),
        ),
        DisturbanceKind(
            "stale_frames",
            "number of observations by which everything that the model sees is late",
            "frames",
            (1.0, 2.0, 3.0, 4.0, 5.0),
            1.0,
            100.0,
            frozenset(Sensor),
            standard=False,
            whole=True,
        ),
        DisturbanceKind(
            "latency",
            "delay from observation to action, while the robot is at rest; it counts as thinking time",
            "s",
            (0.1, 0.2, 0.3, 0.5, 1.0),
            0.001,
            30.0,
            frozenset(),
            standard=False,
        ),
    )
}
"""Kinds by name, in the order in which they are listed."""

STRESS_KINDS: Mapping[str, DisturbanceKind] = {
    **KINDS,
    CONTINUOUS: DisturbanceKind(
        CONTINUOUS,
        "the robot drives on while the model thinks, and answers have this latency; `run --continuous`",
        "s",
        (0.0, 0.3, 1.0, 3.0, 5.0),
        0.0,
        5.0,
        frozenset(),
        standard=False,
    ),
}
"""Kinds of a stress test: also the execution, which is part of the protocol instead of a disturbance."""

STANDARD_SET = tuple(name for name, kind in KINDS.items() if kind.standard)
"""Names of the disturbances that `vsnbench stress` applies by default."""


@dataclass(frozen=True, slots=True, order=True)
class Disturbance:
    """A disturbance with its value in its unit."""

    name: str
    value: float

    @property
    def kind(self) -> DisturbanceKind:
        """The kind of the disturbance."""
        return STRESS_KINDS[self.name]

    @property
    def severity(self) -> int | None:
        """Severity that has this value; None for other values."""
        return next((severity for severity in SEVERITIES if self.kind.values[severity - 1] == self.value), None)

    @property
    def text(self) -> str:
        """As on the command line: `blur=2`."""
        return f"{self.name}={self.value:g}"


@dataclass(frozen=True, slots=True)
class Disturbances:
    """The disturbances of a condition; without any, the model sees what the robot sees."""

    members: tuple[Disturbance, ...] = ()
    """In the order of `KINDS`, each kind once."""

    @classmethod
    def of(cls, members: Iterable[Disturbance]) -> "Disturbances":
        """Return disturbances in the order of `KINDS`."""
        order = list(KINDS)
        return cls(tuple(sorted(members, key=lambda member: order.index(member.name))))

    def __bool__(self) -> bool:
        return bool(self.members)

    def __getitem__(self, name: str) -> float | None:
        """Value of a disturbance, or None if it is not applied."""
        return next((member.value for member in self.members if member.name == name), None)

    @property
    def geometric(self) -> tuple[str, ...]:
        """Names of those that move the camera."""
        return tuple(member.name for member in self.members if member.kind.geometric)

    @property
    def conditions(self) -> dict[str, object]:
        """The disturbances as conditions of a campaign; empty without any, so that clean campaigns keep their hash."""
        if not self.members:
            return {}
        return {DISTURBANCES: {member.name: member.value for member in self.members}, EDITION: CURRENT_EDITION}

    @property
    def text(self) -> str:
        """As on the command line: `blur=2,glare=0.6`; empty without any."""
        return ",".join(member.text for member in self.members)

    def unused_by(self, sensors: frozenset[Sensor]) -> tuple[str, ...]:
        """Return the names of those that change only sensors that a model does not use."""
        changed = {member.name: member.kind.sensors for member in self.members}
        return tuple(name for name, own in changed.items() if own and not own & sensors)


NONE = Disturbances()


def text_of_conditions(conditions: Mapping[str, object]) -> str:
    """Return the disturbances of recorded conditions as on the command line; names of other versions come last."""
    recorded = conditions.get(DISTURBANCES)
    if not isinstance(recorded, Mapping):
        return ""
    order = list(KINDS)
    names = sorted(map(str, recorded), key=lambda name: (order.index(name) if name in KINDS else len(order), name))
    values = (recorded[name] for name in names)
    return ",".join(
        f"{name}={value:g}" if isinstance(value, int | float) else f"{name}={value}"
        for name, value in zip(names, values, strict=True)
    )


_OPTION = "--disturb"
_ITEM = re.compile(r"(?P<name>[^=@]*)(?:(?P<sign>[=@])(?P<value>.*))?", re.DOTALL)
_NUMBER = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*)")


def parse_disturbances(values: Sequence[str]) -> Disturbances:
    """Return the disturbances of the values of `--disturb`, like `blur=2,glare@4` and `low_light`.

    Raises:
        UsageError: a name, unit, value or severity is not valid (`unknown-disturbance`, `invalid-disturbance`), or a
            name is given twice (`duplicate-disturbance`).
    """
    members: dict[str, Disturbance] = {}
    for item in (item for value in values for item in value.split(",")):
        member = _parsed(item.strip())
        if member.name in members:
            raise UsageError(
                f"{_OPTION}: {member.name} is given twice", advice="give each name once", code="duplicate-disturbance"
            )
        members[member.name] = member
    return Disturbances.of(members.values())


def known_kind(name: str, kinds: Mapping[str, DisturbanceKind] = KINDS) -> DisturbanceKind:
    """Return the kind with a name, by default of a disturbance; a hyphen counts as an underscore.

    Raises:
        UsageError: there is none (`unknown-disturbance`).
    """
    kind = kinds.get(name.replace("-", "_"))
    if kind is None:
        near = closest(name.lower().replace("-", "_"), kinds)
        advice = f"did you mean {near}?" if near else f"give {', '.join(kinds)}"
        if name in STRESS_KINDS:
            advice = f"give --{name} SECONDS"
        raise UsageError(f"{_OPTION}: unknown disturbance {name!r}", advice=advice, code="unknown-disturbance")
    return kind


def _severity(text: str, where: str) -> int:
    if text not in {str(severity) for severity in SEVERITIES}:
        raise UsageError(f"{where}: severities are 1 to 5", advice="give 1, 2, 3, 4 or 5", code="invalid-severity")
    return int(text)


def _parsed(item: str) -> Disturbance:
    match = _ITEM.fullmatch(item)
    if match is None or not match["name"]:
        raise _invalid(f"{_OPTION}: cannot read {item!r}", "write blur=2 (in px), blur@3 (severity) or blur")
    kind = known_kind(match["name"].strip())
    if match["sign"] is None:
        return kind.at(DEFAULT_SEVERITY)
    if match["sign"] == "@":
        return kind.at(_severity(match["value"].strip(), f"{_OPTION} {item}"))
    return Disturbance(kind.name, _value(kind, match["value"].strip(), f"{_OPTION} {item}"))


def _value(kind: DisturbanceKind, text: str, where: str) -> float:
    number = _NUMBER.fullmatch(text)
    bounds = f"{kind.lowest:g} to {kind.highest:g} {kind.unit}"
    if number is None:
        raise _invalid(f"{where}: {text!r} is not a finite number", f"give {bounds}")
    if number["unit"] not in ("", kind.unit):
        raise _invalid(f"{where}: {kind.name} is in {kind.unit}, not {number['unit']}", f"give {bounds}")
    value = float(number["number"])
    if not math.isfinite(value) or not kind.lowest <= value <= kind.highest or value == 0:
        raise _invalid(f"{where}: out of range", f"give {bounds}{', not 0' if kind.lowest < 0 else ''}")
    if kind.whole and not value.is_integer():
        raise _invalid(f"{where}: must be a whole number", f"give {bounds}")
    return value


def _invalid(statement: str, advice: str) -> UsageError:
    return UsageError(statement, advice=advice, code="invalid-disturbance")
