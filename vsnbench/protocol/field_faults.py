"""What is wrong with one field of a settings file, and what was likely meant: a misspelling, a comma, centimetres."""

import re
from difflib import get_close_matches
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

_WITH_COMMA = re.compile(r"[-+]?\d+,\d+")
_WITH_UNIT = re.compile(r"([-+]?\d+(?:[.,]\d+)?)\s*(mm|cm|m|°|deg|degrees|rad)")
_IN_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_EITHER_UNIT = 300
"""Things of three metres are rare, and so are those of thirty centimetres: from here a number may be of either unit."""
_IN_BRACKETS = {"tuple_type": "no list of coordinates", "list_type": "no list"}
_OUT_OF_BOUNDS = {"less_than", "less_than_equal", "greater_than", "greater_than_equal"}
_DIRECTIONS = {"right": 0, "east": 0, "up": 90, "north": 90, "left": 180, "west": 180, "down": -90, "south": -90}
_DIRECTIONS |= {"northeast": 45, "northwest": 135, "southwest": -135, "southeast": -45}


def words_of(detail: ErrorDetails, model: type[BaseModel]) -> tuple[str, str]:
    """Return what is wrong with a field, and what to write in its place, empty where nothing likely is known."""
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return "there is no such field", _meant_field(model, detail["loc"])
    if kind == "value_error":
        problem, _, mend = str(detail["ctx"]["error"]).partition(": ")
        return problem, mend
    if kind == "missing":
        return "it is missing", ""
    if kind == "invalid_key":
        return "a name that is no text", "a decimal comma before it? 1.5 is written with a point"
    if isinstance(given, str):
        return _text_for_number(detail, given.strip())
    if kind == "too_long" and isinstance(given, list):
        return _too_many(given, detail["ctx"]["max_length"])
    if kind == "too_short" and isinstance(given, list):
        least = detail["ctx"]["min_length"]
        return (f"at least {least} {'is' if least == 1 else 'are'} needed, and there " + _counted(len(given)), "")
    if kind in _OUT_OF_BOUNDS and isinstance(given, int | float) and not isinstance(given, bool):
        return _out_of_bounds(detail, float(given))
    if given is None and kind in _IN_BRACKETS:
        return "nothing stands under it", "give its entries, or leave the field out if it may be left out"
    if kind == "string_type" and isinstance(given, int | float | bool):
        return detail["msg"], f'in quotes it is one, "{str(given).lower() if isinstance(given, bool) else given}"'
    return detail["msg"], ""


def _counted(number: int) -> str:
    return "is none" if number == 0 else "is one" if number == 1 else f"are {number}"


def _text_for_number(detail: ErrorDetails, given: str) -> tuple[str, str]:
    field = str(detail["loc"][-1]) if detail["loc"] else ""
    if detail["type"] == "string_pattern_mismatch":
        pattern = str(detail["ctx"]["pattern"])
        tidy = re.sub(r"[^a-z0-9_-]+", "-", given.lower()).strip("-_")
        if tidy and pattern.startswith("^[a-z0-9]") and re.fullmatch(pattern, tidy):
            return f"{given!r} has other than lower-case letters, digits, - and _", f"write {tidy}"
        if re.fullmatch("[0-9a-fA-F]{6}", given) and pattern.startswith("^#"):
            return f"{given!r} is no colour", f'write "#{given}", in quotes'
        return detail["msg"], ""
    if _WITH_COMMA.fullmatch(given):
        return f"{given} is no number", f"write {given.replace(',', '.')}, with a point"
    if measured := _WITH_UNIT.fullmatch(given):
        number, unit = float(measured[1].replace(",", ".")), measured[2]
        plain = number * _IN_METRES.get(unit, 1.0) if unit != "rad" else number * 57.29578
        return f"{given!r} is no number", f"units are not written: {plain:g}"
    way = _DIRECTIONS.get(re.sub(r"[\s_-]", "", given.lower()))
    if field.endswith("_deg") and way is not None:
        return f"{given!r} is no number", f"degrees counter-clockwise from x, so right is 0 and up 90: write {way}"
    if (kind := detail["type"]) in _IN_BRACKETS:
        return f"{given[:40]!r} is {_IN_BRACKETS[kind]}", "a list is written in brackets and without quotes, [1.5, 2]"
    return detail["msg"], ""


def _too_many(given: list[Any], most: int) -> tuple[str, str]:
    problem = f"{len(given)} values in place of {most}"
    if len(given) == 2 * most and all(isinstance(each, int) for each in given):
        read = ", ".join(f"{whole}.{part}" for whole, part in zip(given[::2], given[1::2], strict=True))
        return problem, f"a decimal comma? 1.5 is written with a point: [{read}]"
    if (len(given), most) == (3, 2):
        return problem, "a decimal comma? 1.5 is written with a point; a height beside x and y? It is left out"
    return problem, "a decimal comma? 1.5 is written with a point" if len(given) <= 2 * most else ""


def _out_of_bounds(detail: ErrorDetails, given: float) -> tuple[str, str]:
    lengths = [part for part in detail["loc"] if isinstance(part, str) and part.endswith("_m")]
    if not lengths or given <= 0:
        return detail["msg"], ""
    allowed = detail["ctx"]
    most = next((float(allowed[bound]) for bound in ("lt", "le") if bound in allowed), None)
    if most is None:
        return detail["msg"], ""
    problem, centimetres, millimetres = f"{given:g} m is more than {most:g} m", given / 100, given / 1000
    if centimetres <= most and given < _EITHER_UNIT:
        return problem, f"these look like centimetres; in metres it is {centimetres:g}"
    if centimetres <= most:
        return (
            problem,
            f"these look like centimetres or millimetres; in metres it is {centimetres:g} or {millimetres:g}",
        )
    if millimetres <= most:
        return problem, f"these look like millimetres; in metres it is {millimetres:g}"
    return detail["msg"], ""


def _meant_field(model: type[BaseModel], location: tuple[int | str, ...]) -> str:
    fields: set[str] = set()
    for found in _models_at(model, location[:-1]):
        fields |= set(found.model_fields)
    name = str(location[-1])
    near = get_close_matches(name, sorted(fields), n=1, cutoff=0.7)
    near = near or [field for field in sorted(fields) if field.startswith(f"{name}_") or name.startswith(f"{field}_")]
    near = near or [field for field in sorted(fields) if len(name) >= 3 and field.startswith(name)]  # pos, cat
    return f"did you mean {near[0]}?" if near else ""


def _models_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[type[BaseModel]]:
    """Return the models that a place of a file may be, following lists, unions and the tags that choose in them."""
    here: list[Any] = [model]
    for part in location:
        if isinstance(part, str):
            named = [each.model_fields[part].annotation for each in here if part in each.model_fields]
            here = [found for annotation in named for found in _models_in(annotation)] if named else here
    return here


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return [annotation] if issubclass(annotation, BaseModel) else []
    if get_origin(annotation) in (Union, UnionType, list, tuple, dict) or get_args(annotation):
        return [found for part in get_args(annotation) for found in _models_in(part)]
    return []
