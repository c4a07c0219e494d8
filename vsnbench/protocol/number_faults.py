"""What is wrong where a settings file should have a number: text, too small, too large, in another unit than ours."""

import math
import re
from typing import Any

from pydantic_core import ErrorDetails

Words = tuple[str, str]
"""What is wrong, and what to write in its place; empty where nothing likely is known."""

_WITH_COMMA = re.compile(r"[-+]?\d+,\d+")
_WITH_UNIT = re.compile(r"([-+]?\d+(?:[.,]\d+)?)\s*(mm|cm|m|°|deg|degrees|rad|%)")
_TIMES = {"mm": 1e-3, "cm": 1e-2, "rad": 57.29578, "%": 1e-2}
_EITHER_UNIT = 300
"""Things of three metres are rare, and so are those of thirty centimetres: from here a number may be of either unit."""
_DIRECTIONS = {"right": 0, "east": 0, "up": 90, "north": 90, "left": 180, "west": 180, "down": -90, "south": -90}
_DIRECTIONS |= {"northeast": 45, "northwest": 135, "southwest": -135, "southeast": -45}

_PLACES = ("position", "polygon", "footprint", "start", "end")
"""Fields of coordinates, which are metres with nothing in their names that says so."""
_UNITS = (
    ("_m_s", " m/s", "metres a second"),
    ("_rad_s", " rad/s", "radians a second"),
    ("_m", " m", "metres"),
    ("_deg", "°", "degrees"),
    ("_kg", " kg", "kilograms"),
    ("_hz", " Hz", "times a second"),
    ("_s", " s", "seconds"),
)
"""How a field's name ends -> the sign of its unit, and its name."""

_WHOLE = {"int_type", "int_parsing", "int_from_float", "int_parsing_size"}
_NO_NUMBER = {"float_type", "float_parsing", "finite_number"} | _WHOLE
_LEAST = {"greater_than": ("gt", "above {}"), "greater_than_equal": ("ge", "{} at least")}
_MOST = {"less_than": ("lt", "below {}"), "less_than_equal": ("le", "{} at most")}


def number_words(detail: ErrorDetails) -> Words | None:
    """Return what is wrong with a number; None where the field takes something else."""
    kind, given = detail["type"], detail["input"]
    if kind in _NO_NUMBER:
        return _no_number(kind, given, _field_of(detail))
    if kind not in _LEAST | _MOST:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float):
        return _no_number(kind, given, _field_of(detail))
    if not math.isfinite(given):
        return _no_number("finite_number", given, _field_of(detail))
    bound, wanted = (_LEAST | _MOST)[kind]
    limit = float(detail["ctx"][bound])
    sign = _unit_of(_field_of(detail))[0]
    if kind in _LEAST:
        problem = f"{given:g}{sign} is too small ({wanted.format(f'{limit:g}{sign}')})"
        return problem, f"without the minus it is {-given:g}" if given < 0 and -given > limit else ""
    if given == limit:
        return f"{given:g}{sign} is too large ({wanted.format(f'{limit:g}{sign}')})", ""
    return f"{given:g}{sign} is more than {limit:g}{sign}", _other_unit(_field_of(detail), float(given), limit)


def as_written(given: Any) -> str:
    """Return a value as a file has it, for a message: short, and in one line."""
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


def _field_of(detail: ErrorDetails) -> str:
    return next((part for part in reversed(detail["loc"]) if isinstance(part, str)), "")


def _unit_of(field: str) -> tuple[str, str]:
    """Return the sign of a field's unit, with the space before it, and its name; both empty for a plain number."""
    if field in _PLACES:
        return " m", "metres"
    return next(((sign, name) for end, sign, name in _UNITS if field.endswith(end)), ("", ""))


def _no_number(kind: str, given: Any, field: str) -> Words:
    wanted = "whole number" if kind in _WHOLE else "number"
    text = given.strip() if isinstance(given, str) else ""
    if _WITH_COMMA.fullmatch(text):
        return f"{text} is no number", f"write {text.replace(',', '.')}, with a point"
    if measured := _WITH_UNIT.fullmatch(text):
        plain = float(measured[1].replace(",", ".")) * _TIMES.get(measured[2], 1.0)
        return f"{text!r} is no number", f"units are not written: {plain:g}"
    way = _DIRECTIONS.get(re.sub(r"[\s_-]", "", text.lower()))
    if field.endswith("_deg") and way is not None:
        return f"{text!r} is no number", f"degrees counter-clockwise from x, so right is 0 and up 90: write {way}"
    unit = _unit_of(field)[1]
    mend = f"write one, in {unit}" if unit else ""
    if given is None:
        return f"nothing stands where a {wanted} belongs", mend
    if isinstance(given, list | dict):
        return f"{as_written(given)} stands where one {wanted} belongs", mend
    return f"{as_written(given)} is no {wanted}", mend


def _other_unit(field: str, given: float, most: float) -> str:
    """Return in which unit a number was likely meant that is more than may be; empty where none is likely."""
    sign, name = _unit_of(field)
    if sign.startswith(" m"):
        return _shorter_unit(given, most, name)
    if name == "radians a second" and math.radians(given) <= most:
        return f"these look like degrees a second; in radians it is {math.radians(given):.3g}"
    if not name and most <= 1 <= given and given / 100 <= most:
        return f"it is a share of 1, and this looks like percent: {given:g} % is {given / 100:g}"
    return ""


def _shorter_unit(given: float, most: float, name: str) -> str:
    centimetres, millimetres = given / 100, given / 1000
    if given < 1:
        return ""
    if centimetres <= most and given < _EITHER_UNIT:
        return f"these look like centimetres; in {name} it is {centimetres:g}"
    if centimetres <= most:
        return f"these look like centimetres or millimetres; in {name} it is {centimetres:g} or {millimetres:g}"
    return f"these look like millimetres; in {name} it is {millimetres:g}" if millimetres <= most else ""
