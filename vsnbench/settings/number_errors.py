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
    symbol = unit_of(field)[0]
    statement = f"must be {relation} {limit:g}{symbol}, got {given:g}{symbol}"
    return FieldError(statement, other_unit(field, float(given), limit) if kind in _UPPER_BOUNDS else "")


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


def unit_of(field: str) -> tuple[str, str]:
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
    unit = unit_of(field)[1]
    return FieldError(statement, f"write it in {unit}" if unit else "")


def other_unit(field: str, given: float, limit: float) -> str:
    """Return the largest unit in which a length or an angle above its limit is possible; empty for other numbers."""
    if field.endswith("_rad") and math.radians(given) <= limit:
        return f"this looks like degrees; in radians it is {math.radians(given):.4g}"
    name = unit_of(field)[1]
    if given < 1 or not name.startswith("metres"):
        return ""
    units = (("centimetres", 100), ("millimetres", 1000))
    return next(
        (f"this looks like {unit}; in {name} it is {given / n:g}" for unit, n in units if given / n <= limit), ""
    )
