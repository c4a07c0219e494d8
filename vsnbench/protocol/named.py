"""Named protocols, and protocols of a user's YAML file.

A published protocol never changes its values: records refer to it. A changed one gets a new name.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Self

from pydantic import BaseModel, Field, model_validator

from vsnbench.errors import ProtocolError, UsageError
from vsnbench.protocol.parameters import PAPER_PROTOCOL, ProtocolParameters
from vsnbench.settings.validation import SettingsFault
from vsnbench.settings.yaml_file import read_settings, settings_faults
from vsnbench.text.suggestions import closest

_PAPER_SECTION = "paper, Section 4.1"
_GUARD_SECTION = "paper, Section 3.2.2"
_OURS = "vsnbench, docs/protocol.md"
_DEFAULT_SOURCES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "max_actions": _PAPER_SECTION,
        "success_distance_m": _PAPER_SECTION,
        "forward_m": _PAPER_SECTION,
        "turn_deg": _PAPER_SECTION,
        "depth_guard.enabled": _GUARD_SECTION,
    }
)
_UNITS: Final = (("_m", "m"), ("_s", "s"), ("_deg", "degrees"), ("max_actions", "actions"), ("_pixels", "pixels"))
_HABITAT = "Habitat ObjectNav challenges 2020 to 2022; Batra et al., ObjectNav Revisited (2020)"
_ONSITE = (
    "rules of the onsite phase, navigation track of the IROS 2025 challenge: "
    "InternRobotics/InternNav, challenge/onsite_competition/onsite_competition_rules_en-US.md, 4.3 and 5.1"
)
_ONSITE_ROBOT = "its robot's code: InternRobotics/InternNav, challenge/onsite_competition/sdk/real_world_env.py"
_GOAT = "GOAT-Bench (Khanna et al., CVPR 2024) and its code: Ram81/goat-bench, README.md and config/tasks"


@dataclass(frozen=True, slots=True)
class NamedProtocol:
    """A protocol of the package, with where its values come from."""

    summary: str
    parameters: ProtocolParameters
    sources: Mapping[str, str] = field(default_factory=dict)
    """Parameter -> source, where it is not that of the default."""


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One parameter of a protocol."""

    name: str
    """Path of the field, like `depth_guard.distance_m`."""
    value: Any
    unit: str
    default: Any
    """Value in the paper's protocol."""
    source: str
    meaning: str


NAMED: Final[Mapping[str, NamedProtocol]] = MappingProxyType(
    {
        PAPER_PROTOCOL: NamedProtocol("the paper's protocol (Section 4.1), the default", ProtocolParameters()),
        "habitat-objectnav": NamedProtocol(
            "the limits of Habitat's ObjectNav challenges",
            ProtocolParameters(
                name="habitat-objectnav", max_actions=500, forward_m=0.25, turn_deg=30.0, success_distance_m=1.0
            ),
            dict.fromkeys(("max_actions", "forward_m", "turn_deg", "success_distance_m"), _HABITAT),
        ),
        "onsite-instruction": NamedProtocol(
            "onsite contests of instruction following: 6 minutes, STOP within 2 m in sight, no collision",
            ProtocolParameters(
                name="onsite-instruction",
                max_actions=1000,
                max_time_s=360.0,
                success_distance_m=2.0,
                forward_m=0.2,
                turn_deg=15.0,
            ),
            {
                **dict.fromkeys(("max_time_s", "success_distance_m"), _ONSITE),
                **dict.fromkeys(("forward_m", "turn_deg"), _ONSITE_ROBOT),
                "max_actions": "vsnbench: ends a model that never moves; the contest has no such limit",
            },
        ),
        "goat-sequence": NamedProtocol(
            "sequences of goals with the limits of GOAT-Bench: 500 actions for each goal",
            ProtocolParameters(
                name="goat-sequence", max_actions=500, forward_m=0.25, turn_deg=30.0, success_distance_m=1.0
            ),
            dict.fromkeys(("max_actions", "forward_m", "turn_deg", "success_distance_m"), _GOAT),
        ),
    }
)
"""Name -> protocol, the default first."""


class ProtocolFile(ProtocolParameters):
    """Content of a protocol file: a name of its own, and the parameters that differ from the paper's."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$", description="name of the protocol, in tables")

    @model_validator(mode="after")
    def _check_name(self) -> Self:
        named = NAMED.get(self.name)
        if named is not None and self.parameters() != named.parameters:
            raise ValueError(f"name {self.name} belongs to a built-in protocol with other values: choose another name")
        return self

    @model_validator(mode="after")
    def _check_guard(self) -> Self:
        if self.depth_guard.enabled and self.depth_guard.distance_m < self.forward_m:
            raise ValueError(
                f"the depth guard looks {self.depth_guard.distance_m:g} m ahead, less than a move of "
                f"{self.forward_m:g} m: set depth_guard.distance_m to {min(2.0, self.forward_m + 0.15):g} or more"
            )
        return self

    def parameters(self) -> ProtocolParameters:
        """Return the parameters, equal to those of any other source with the same values."""
        return ProtocolParameters.model_validate(self.model_dump())


def load_protocol(name_or_path: str) -> ProtocolParameters:
    """Return a named protocol, or that of a YAML file.

    Raises:
        UsageError: there is no such protocol (`unknown-protocol`).
        ProtocolError: the file cannot be read or breaks the format; see `parse_settings` for the codes.
    """
    if name_or_path in NAMED:
        return NAMED[name_or_path].parameters
    return read_settings(protocol_file(name_or_path), ProtocolFile, ProtocolError, "protocol").parameters()


def protocol_file_faults(path: str) -> list[SettingsFault]:
    """Return all faults of a protocol file, with lines and fields.

    Raises:
        UsageError: the file does not exist (`unknown-protocol`).
        ProtocolError: the file cannot be read.
    """
    return settings_faults(protocol_file(path), ProtocolFile, ProtocolError, "protocol")


def protocol_file(name_or_path: str) -> Path:
    """Return the path of a protocol file.

    Raises:
        UsageError: there is no such file (`unknown-protocol`).
    """
    path = Path(name_or_path)
    if not path.is_file():
        suggestion = closest(name_or_path, NAMED)
        raise UsageError(
            f"protocol {name_or_path!r} does not exist",
            advice=f"did you mean {suggestion!r}?"
            if suggestion
            else f"give one of {', '.join(NAMED)}, or the path of a protocol file",
            code="unknown-protocol",
        )
    return path


def parameter_rows(parameters: ProtocolParameters, origin: str = "") -> list[ParameterRow]:
    """Return every parameter with its value, unit, default and source.

    Args:
        parameters: the protocol.
        origin: source of the values that differ from the default and are not those of a named protocol.
    """
    paper, named = ProtocolParameters(), NAMED.get(parameters.name)
    sources = named.sources if named is not None and parameters == named.parameters else {}
    rows = []
    for name, value, default, meaning in _leaves(parameters, paper):
        source = _DEFAULT_SOURCES.get(name, _OURS)
        if name in sources:
            source = sources[name]
        elif value != default and name not in ("name", "version"):
            source = origin
        unit = next((unit for ending, unit in _UNITS if name.endswith(ending)), "")
        rows.append(ParameterRow(name, value, unit, default, source, meaning))
    return rows


def _leaves(values: BaseModel, defaults: BaseModel | None, within: str = "") -> Iterator[tuple[str, Any, Any, str]]:
    """Yield name, value, default and meaning of every field; those of nested models one by one."""
    for name, info in type(values).model_fields.items():
        value, default = getattr(values, name), getattr(defaults, name, None)
        if isinstance(value, BaseModel):
            yield from _leaves(value, default, f"{within}{name}.")
        else:
            yield f"{within}{name}", value, default, info.description or ""
