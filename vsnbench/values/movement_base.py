"""What every kind of movement has: declared parameters, from which its check and its JSON follow, and its behaviour."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from enum import StrEnum
from functools import cache
from types import NoneType
from typing import Any, ClassVar, Self, get_args, get_type_hints

from vsnbench.errors import DecisionError
from vsnbench.settings.number_errors import other_unit, unit_of
from vsnbench.values.pose import Pose

Points = tuple[tuple[float, float], ...]
"""(x, y) each."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """What a field of a movement means, and its limits: `left_m: Annotated[float, Parameter("to the left", 5.0)]`.

    The type is float, `float | None`, bool or `Points`; the name ends with the unit.
    """

    meaning: str
    """In a line, without the unit."""
    most: float = math.inf
    """Largest value; for points, their largest number."""
    least: float | None = None
    """Smallest value or number of points; None for the opposite of `most`."""
    absent: str = ""
    """What it means if it is absent in JSON, such as `for any`. Its default is then left out; without this, never."""
    is_internal: bool = False
    """Whether models cannot set it."""
    name: str = ""
    """This and the next two are those of the field; its default is `...` if it must be given."""
    type: Any = float
    default: Any = ...

    @property
    def limits(self) -> str:
        """The limits with their unit, such as `0.05 to 2 s`; empty without limits."""
        unit = f" {self.name}" if self.type == Points else unit_of(self.name)[0]
        return "" if math.isinf(self.most) else f"{self._least:.4g} to {self.most:.4g}{unit}"

    @property
    def _least(self) -> float:
        return -self.most if self.least is None else self.least

    def checked(self, value: object, kind: str) -> Any:
        """Return a validated copy of a value.

        Raises:
            DecisionError: it has another type, or is not finite or beyond a limit.
        """
        what = f"{kind}.{self.name}"
        if self.type == Points:
            return self._checked_points(value, kind)
        if value is None and NoneType in get_args(self.type):
            return None
        number = _checked_number(value, what)
        if self._least <= number <= self.most:
            return number
        allowed = f"between {self._least:.4g} and {self.most:.4g}" if self.least is None else self.limits
        advice = other_unit(what, abs(number), self.most)
        raise DecisionError(f"{what} must be {allowed}, got {number:.6g}", advice=advice)

    def _checked_points(self, value: object, kind: str) -> Points:
        what = f"{kind}.{self.name}"
        if not isinstance(value, tuple | list):
            raise DecisionError(f"{what} must be a list of (x, y), got {type(value).__name__}")
        if not self._least <= len(value) <= self.most:
            raise DecisionError(f"a {kind} must have {self.limits}, got {len(value)}")
        return tuple(_checked_point(point, f"{what}[{k}]") for k, point in enumerate(value))

    def to_json(self, value: Any) -> Any:
        """Return a value for JSON."""
        return [list(point) for point in value] if self.type == Points else value

    def from_json(self, value: Any) -> Any:
        """Return a value of JSON.

        Raises:
            TypeError, ValueError: it has another type, or is not finite.
        """
        if self.type is bool:
            return value is True
        return tuple((_finite(x), _finite(y)) for x, y in value) if self.type == Points else _finite(value)


class MovementBase:
    """Base class of the kinds of movements: frozen dataclasses whose fields are declared with `Parameter`."""

    __slots__ = ()
    kind: ClassVar[StrEnum]
    """Its name in messages, JSON and records, of `ActionKind`."""
    limit: ClassVar[str] = ""
    """Limit of the movement as a whole, in words, such as `at most 5 m away`."""
    replaces_path: ClassVar[bool] = False
    """Whether it can replace a running path; others go from rest to rest."""
    is_straight: ClassVar[bool] = True
    """Whether the distance to the end is the way that is left."""

    @classmethod
    @cache
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared parameters, in order."""
        hints = get_type_hints(cls, include_extras=True)
        found = []
        for field in fields(cls):  # type: ignore[arg-type]  # every kind is a dataclass
            kind, parameter = get_args(hints[field.name])
            default = ... if field.default is MISSING else field.default
            found.append(replace(parameter, name=field.name, type=kind, default=default))
        return tuple(found)

    def check(self) -> None:
        """Check the movement as a whole, after its parameters.

        Raises:
            DecisionError: it is beyond `limit`.
        """

    @classmethod
    def checked(cls, given: Any) -> Self:
        """Return a validated copy of a movement of this class, without what models cannot set.

        Raises:
            DecisionError: a number is not finite or beyond its limit.
        """
        declared = [parameter for parameter in cls.parameters() if not parameter.is_internal]
        values = {parameter.name: parameter.checked(getattr(given, parameter.name), cls.kind) for parameter in declared}
        movement = cls(**values)
        movement.check()
        return movement

    def to_json(self) -> dict[str, Any]:
        """Return the movement as JSON values with its `kind`, for the record and the wire."""
        content: dict[str, Any] = {"kind": self.kind.value}
        for parameter in self.parameters():
            value = getattr(self, parameter.name)
            if not parameter.absent or value != parameter.default:
                content[parameter.name] = parameter.to_json(value)
        return content

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """Return the movement of `to_json`; unknown keys are ignored.

        Raises:
            TypeError, ValueError: a key is missing, or a number is not finite.
        """
        given = ((parameter, content.get(parameter.name)) for parameter in cls.parameters())
        return cls(**{parameter.name: parameter.from_json(value) for parameter, value in given if value is not None})

    @property
    def end(self) -> Pose | None:
        """The pose at the end in the robot's frame; None if it depends on how the base accelerates."""
        return None

    @property
    def reach_m(self) -> float:
        """The largest distance from the robot's position on the way; by default, that of the end."""
        end = self.end
        return 0.0 if end is None else math.hypot(end.x_m, end.y_m)

    @property
    def holds_heading(self) -> bool:
        """Whether it is an action of the paper, with the sizes of a protocol."""
        return False

    @property
    def ahead(self) -> float:
        """A positive number if the robot drives forwards, where its camera looks; negative backwards, else 0.

        A point behind the robot is reached forwards, after a turn.
        """
        return 1.0

    @property
    def fixes_heading(self) -> bool:
        """Whether it prescribes the heading at its end."""
        return False

    @property
    def goes_sideways(self) -> bool:
        """Whether only a base with `max_lateral_m_s` executes it."""
        return False

    @property
    def is_watched(self) -> bool:
        """Whether a camera that looks ahead shows the way: not if the robot goes straight to the side."""
        return not self.goes_sideways or self.ahead > 0


def require_length(length_m: float, most_m: float, rule: str) -> None:
    """Check a length.

    Raises:
        DecisionError: it is above the most; the error begins with the rule.
    """
    if length_m > most_m:
        raise DecisionError(f"{rule}, got {length_m:.4g} m", advice=other_unit("_m", length_m, most_m))


def _checked_point(value: Any, what: str) -> tuple[float, float]:
    try:
        x_m, y_m = value
    except (TypeError, ValueError):
        raise DecisionError(f"{what} must be a point (x, y)") from None
    return _checked_number(x_m, f"{what}.x_m"), _checked_number(y_m, f"{what}.y_m")


def _checked_number(value: Any, what: str) -> float:
    try:
        if not isinstance(value, str | bytes | bytearray) and math.isfinite(number := float(value)):
            return number
    except (TypeError, ValueError, OverflowError):
        pass
    raise DecisionError(f"{what} must be a finite number, got {str(value)[:40]}")


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} is not a finite number")
    return number
