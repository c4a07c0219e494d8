"""What is wrong with one field of a settings file, and what was likely meant: a misspelling, a comma, centimetres."""

import re
import unicodedata
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from vsnbench.protocol.field_places import (
    Location,
    description_at,
    fields_of,
    is_mapping,
    lengths_of,
    models_at,
    required_of,
    takes_text,
    types_at,
)
from vsnbench.protocol.number_faults import Words, as_written, number_words

_NO_LIST = {"tuple_type", "list_type"}
_NO_MAPPING = {"model_type", "model_attributes_type", "dict_type"}
_NO_TEXT = {"string_type", "string_pattern_mismatch", "string_too_short", "string_too_long"}
_NO_TRUTH = {"bool_type", "bool_parsing"}
_NUMBERS_IN_TEXT = re.compile(r"[-+.\d]+(?:\s*,\s*[-+.\d]+)*")


def words_of(detail: ErrorDetails, model: type[BaseModel]) -> Words:
    """Return what is wrong with a field, and what to write in its place, empty where nothing likely is known.

    Args:
        detail: as pydantic found it.
        model: what the whole file has to be.
    """
    statement, mend = _words_of(detail, model)
    return statement, mend or ("" if detail["type"] in _SAYS_ALL else description_at(model, detail["loc"]))


_SAYS_ALL = {"extra_forbidden", "value_error", "missing", "invalid_key", "too_long", "too_short", *_NO_MAPPING}


def _words_of(detail: ErrorDetails, model: type[BaseModel]) -> Words:
    kind, given, place = detail["type"], detail["input"], detail["loc"]
    if kind == "extra_forbidden":
        return "there is no such field", _meant_field(model, place)
    if kind == "value_error":
        problem, _, mend = str(detail["ctx"]["error"]).partition(": ")
        return problem, mend
    if kind == "missing":
        return _missing(given, model, place)
    if kind == "invalid_key":
        return "a name that is no text", "a decimal comma before it? 1.5 is written with a point"
    if (words := number_words(detail)) is not None:
        return words
    if kind in {"too_long", "too_short"}:
        return _wrong_length(detail)
    if kind in _NO_LIST:
        return _no_list(given, types_at(model, place))
    if kind in _NO_MAPPING:
        return _no_mapping(given, types_at(model, place), models_at(model, place))
    if kind in _NO_TEXT:
        return _no_text(detail)
    if kind in _NO_TRUTH:
        return f"{as_written(given)} is neither true nor false", "write one of them"
    if kind in {"literal_error", "enum"}:
        expected = str(detail["ctx"]["expected"])
        near = get_close_matches(str(given), re.findall("'([^']+)'", expected), n=1, cutoff=0.6)
        return f"{as_written(given)} is none of its words", f"did you mean {near[0]}?" if near else f"write {expected}"
    if kind == "union_tag_invalid":
        tags = str(detail["ctx"]["expected_tags"]).replace(", ", " or ")
        name = str(detail["ctx"]["discriminator"]).strip("'")
        return f"there is no {name} {as_written(str(detail['ctx']['tag']))}", f"write {tags}"
    return detail["msg"], ""


def _missing(given: Any, model: type[BaseModel], place: Location) -> Words:
    if isinstance(place[-1], int) and isinstance(given, list):
        wanted = max((length for each in types_at(model, place[:-1]) for length in lengths_of(each)), default=0)
        return f"{len(given)} {'value' if len(given) == 1 else 'values'} in place of {wanted}", description_at(
            model, place
        )
    return "it is missing", ""


def _wrong_length(detail: ErrorDetails) -> Words:
    given = detail["input"]
    if not isinstance(given, list):
        return detail["msg"], ""
    if detail["type"] == "too_long":
        return _too_many(given, detail["ctx"]["max_length"])
    least = detail["ctx"]["min_length"]
    return f"at least {least} {'is' if least == 1 else 'are'} needed, and there " + _counted(len(given)), ""


def _counted(number: int) -> str:
    return "is none" if number == 0 else "is one" if number == 1 else f"are {number}"


def _too_many(given: list[Any], most: int) -> Words:
    problem = f"{len(given)} values in place of {most}"
    if len(given) == 2 * most and all(isinstance(each, int) for each in given):
        read = ", ".join(f"{whole}.{part}" for whole, part in zip(given[::2], given[1::2], strict=True))
        return problem, f"a decimal comma? 1.5 is written with a point: [{read}]"
    if (len(given), most) == (3, 2):
        return problem, "a decimal comma? 1.5 is written with a point; a height beside x and y? It is left out"
    return problem, "a decimal comma? 1.5 is written with a point" if len(given) <= 2 * most else ""


def _no_list(given: Any, wanted: list[Any]) -> Words:
    if given is None:
        return "nothing stands under it", "give its entries, or leave the field out if it may be left out"
    count = max(map(_length, wanted), default=0)
    if isinstance(given, dict):
        return "a mapping stands where a list belongs", "" if count else "each of its entries begins with -"
    if not isinstance(given, str):
        return f"{as_written(given)} is no list", f"{count} values belong there, in brackets" if count else ""
    text = given.strip()[:40]
    if any(takes_text(each) for each in wanted) and not _NUMBERS_IN_TEXT.fullmatch(text):
        return f"{text!r} is no list", f"in brackets it is one, [{text}]"
    example = ", ".join(("1.5", "2", "0.5")[: count or 2])
    what = "no list of coordinates" if count else "no list"
    return f"{text!r} is {what}", f"a list is written in brackets and without quotes, [{example}]"


def _length(annotation: Any) -> int:
    return max(lengths_of(annotation), default=0)


def _no_mapping(given: Any, wanted: list[Any], models: list[type[BaseModel]]) -> Words:
    fields = ", ".join((required_of(models) or fields_of(models))[:5])
    problem = f"{as_written(given)} stands where a mapping belongs"
    if any(is_mapping(each) for each in wanted):
        return problem, "a name for each, and under it " + (fields or "what it is")
    return problem, f"it has {fields}" if fields else ""


def _no_text(detail: ErrorDetails) -> Words:
    kind, given = detail["type"], detail["input"]
    colour = str(detail["loc"][-1]).endswith("color") if detail["loc"] else False
    if kind == "string_pattern_mismatch":
        return _wrong_text(str(given).strip(), str(detail["ctx"]["pattern"]), colour)
    if kind == "string_too_short":
        return "it is empty", ""
    if kind == "string_too_long":
        return f"{len(given)} characters, and {detail['ctx']['max_length']} at most", ""
    if given is None:
        return "nothing stands under it", "leave the field out, or write text"
    if colour and isinstance(given, int):
        return f"{given} is no colour", f'write "#{given:06d}", in quotes'
    if isinstance(given, list) and given and all(isinstance(each, int | str) for each in given):
        return "a list where text belongs", f'in quotes, "{",".join(str(each) for each in given)[:40]}"'
    if isinstance(given, list | dict):
        return f"{as_written(given)} where text belongs", ""
    return f"{as_written(given)} is no text", f'in quotes it is, "{as_written(given)}"'


def _wrong_text(given: str, pattern: str, colour: bool) -> Words:
    if not given:
        return "it is empty", ""
    if colour:
        hexadecimal = re.fullmatch("[0-9a-fA-F]{6}", given)
        return (
            f"{given[:40]!r} is no colour",
            f'write "#{given}", in quotes' if hexadecimal else 'one is "#a05a2c", in quotes',
        )
    plain = unicodedata.normalize("NFKD", given.lower()).encode("ascii", "ignore").decode()
    tidy = re.sub(r"[^a-z0-9_-]+", "-", plain).strip("-_")
    if tidy and pattern.startswith("^[a-z0-9]") and re.fullmatch(pattern, tidy):
        return f"{given[:40]!r} has other than lower-case letters, digits, - and _", f"write {tidy}"
    if "/" in pattern:
        return f"{given[:40]!r} is no name in ROS", "one has letters, digits, _ and /, and no blank"
    return f"{given[:40]!r} is not of its form", f"that is {pattern}"


def _meant_field(model: type[BaseModel], location: Location) -> str:
    fields = sorted(fields_of(models_at(model, location[:-1])))
    name = str(location[-1])
    near = get_close_matches(name, fields, n=1, cutoff=0.7)
    near = near or [field for field in fields if field.startswith(f"{name}_") or name.startswith(f"{field}_")]
    near = near or [field for field in fields if len(name) >= 3 and field.startswith(name)]  # pos, cat
    return f"did you mean {near[0]}?" if near else ""
