"""Descriptions of invalid numbers in settings files: text, too small, too large, in a wrong unit."""

import math
import re
from typing import Any, NamedTuple

from pydantic_core import ErrorDetails


class FieldError(NamedTuple):
    """Description of an invalid field."""

    statement: str
    advice: str = ""
    """The likely fix, or an empty string."""
    code: str = "invalid-field"


_WITH_COMMA = re.compile(r"[-+]?\d+,\d+")
_WITH_UNIT = re.compile(r"([-+]?\d+(?:[.,]\d+)?)\s*(mm|cm|m|°|deg|degrees|rad|%)")
_FACTORS = {"mm": 1e-3, "cm": 1e-2, "rad": 57.29578, "%": 1e-2}
_EITHER_UNIT = 300
"""From here on a length may be in centimetres or in millimetres: 3 m and 30 cm are both unusual sizes."""
_DIRECTIONS = {"right": 0, "east": 0, "up": 90, "north": 90, "left": 180, "west": 180, "down": -90, "south": -90}
_DIRECTIONS |= {"northeast": 45, "northwest": 135, "southwest": -135, "southeast": -45}

_COORDINATES = ("position", "polygon", "footprint", "start", "end")
"""Fields of coordinates: metres, although their names have no unit."""
_UNITS = (
    ("_m_s", " m/s", "metres per second"),
    ("_rad_s", " rad/s", "radians per second"),
    ("_m", " m", "metres"),
    ("_deg", "°", "degrees"),
    ("_kg", " kg", "kilograms"),
    ("_hz", " Hz", "hertz"),
    ("_s", " s", "seconds"),
)
"""End of a field's name, symbol of its unit, name of its unit."""

_INTEGER_ERRORS = {"int_type", "int_parsing", "int_from_float", "int_parsing_size"}
_NUMBER_ERRORS = {"float_type", "float_parsing", "finite_number"} | _INTEGER_ERRORS
_LOWER_BOUNDS = {"greater_than": ("gt", "above"), "greater_than_equal": ("ge", "at least")}
_UPPER_BOUNDS = {"less_than": ("lt", "below"), "less_than_equal": ("le", "at most")}


def describe_number_error(detail: ErrorDetails) -> FieldError | None:
    """Describe an error about a number; None if the error is about another type."""
    kind, given = detail["type"], detail["input"]
    field = next((part for part in reversed(detail["loc"]) if isinstance(part, str)), "")
    if kind in _NUMBER_ERRORS:
        return _not_a_number(kind, given, field)
    if kind not in _LOWER_BOUNDS | _UPPER_BOUNDS:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float):
        return _not_a_number(kind, given, field)
    if not math.isfinite(given):
        return _not_a_number("finite_number", given, field)
    bound, relation = (_LOWER_BOUNDS | _UPPER_BOUNDS)[kind]
    limit = float(detail["ctx"][bound])
    symbol = _unit_of(field)[0]
    statement = f"must be {relation} {limit:g}{symbol}, got {given:g}{symbol}"
    if kind in _LOWER_BOUNDS:
        return FieldError(statement, f"without the minus sign it is {-given:g}" if given < 0 and -given > limit else "")
    return FieldError(statement, _other_unit(field, float(given), limit) if given != limit else "")


def as_written(given: Any) -> str:
    """Return a value as YAML writes it, shortened to one line for messages."""
    if given is None:
        return "nothing"
    if isinstance(given, bool):
        return str(given).lower()
    if isinstance(given, float) and not math.isfinite(given):
        return ".nan" if math.isnan(given) else f"{'-' * (given < 0)}.inf"
    if isinstance(given, list | tuple):
        return "a list"
    if isinstance(given, dict):
        return "a mapping"
    return repr(given[:40]) if isinstance(given, str) else str(given)[:40]


def _unit_of(field: str) -> tuple[str, str]:
    """Return the symbol of a field's unit, with a space before it, and its name; both empty without a unit."""
    if field in _COORDINATES:
        return " m", "metres"
    return next(((symbol, name) for end, symbol, name in _UNITS if field.endswith(end)), ("", ""))


def _not_a_number(kind: str, given: Any, field: str) -> FieldError:
    wanted = "a whole number" if kind in _INTEGER_ERRORS else "a number"
    statement = f"expected {wanted}, got {as_written(given)}"
    text = given.strip() if isinstance(given, str) else ""
    if _WITH_COMMA.fullmatch(text):
        return FieldError(statement, f"write {text.replace(',', '.')}, with a point")
    if measured := _WITH_UNIT.fullmatch(text):
        plain = float(measured[1].replace(",", ".")) * _FACTORS.get(measured[2], 1.0)
        return FieldError(statement, f"write it without the unit: {plain:g}")
    heading_deg = _DIRECTIONS.get(re.sub(r"[\s_-]", "", text.lower()))
    if field.endswith("_deg") and heading_deg is not None:
        advice = f"headings are degrees counter-clockwise from x, so right is 0 and up 90: write {heading_deg}"
        return FieldError(statement, advice)
    unit = _unit_of(field)[1]
    return FieldError(statement, f"write it in {unit}" if unit else "")


def _other_unit(field: str, given: float, limit: float) -> str:
    """Return advice about the likely unit of a number above its limit; empty if no unit is likely."""
    symbol, name = _unit_of(field)
    if symbol.startswith(" m"):
        return _shorter_unit(given, limit, name)
    if name == "radians per second" and math.radians(given) <= limit:
        return f"this looks like degrees per second; in radians it is {math.radians(given):.3g}"
    if not name and limit <= 1 <= given and given / 100 <= limit:
        return f"this looks like percent: write {given:g} % as {given / 100:g}"
    return ""


def _shorter_unit(given: float, limit: float, name: str) -> str:
    centimetres, millimetres = given / 100, given / 1000
    if given < 1:
        return ""
    if centimetres <= limit and given < _EITHER_UNIT:
        return f"this looks like centimetres; in {name} it is {centimetres:g}"
    if centimetres <= limit:
        return f"this looks like centimetres or millimetres; in {name} it is {centimetres:g} or {millimetres:g}"
    return f"this looks like millimetres; in {name} it is {millimetres:g}" if millimetres <= limit else ""
