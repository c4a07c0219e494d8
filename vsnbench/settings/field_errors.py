"""Descriptions of invalid fields in settings files, with a likely fix: a misspelling, a decimal comma, a wrong unit."""

import re
import unicodedata
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

from pydantic_core import ErrorDetails

from vsnbench.settings.field_types import (
    Location,
    description_at,
    fields_of,
    is_mapping,
    lengths_of,
    models_at,
    takes_text,
    types_at,
)
from vsnbench.settings.number_errors import FieldError, as_written, describe_number_error

_LIST_ERRORS = {"tuple_type", "list_type"}
_MAPPING_ERRORS = {"model_type", "model_attributes_type", "dict_type"}
_TEXT_ERRORS = {"string_type", "string_pattern_mismatch", "string_too_short", "string_too_long"}
_BOOLEAN_ERRORS = {"bool_type", "bool_parsing"}
_NUMBERS_IN_TEXT = re.compile(r"[-+.\d]+(?:\s*,\s*[-+.\d]+)*")


class FieldsError(ValueError):
    """Errors of several fields that one validator found, each with its place below the validated field."""

    def __init__(self, errors: Sequence[tuple[Location, str]]) -> None:
        """Keep at least one error; the text is the first."""
        super().__init__(errors[0][1])
        self.errors = tuple(errors)


def describe_errors(detail: ErrorDetails, model: type) -> list[tuple[Location, FieldError]]:
    """Describe an error that pydantic found in a file with this model, with its place; a `FieldsError` has several."""
    cause = detail.get("ctx", {}).get("error")
    if not isinstance(cause, FieldsError):
        return [(detail["loc"], describe_error(detail, model))]
    return [((*detail["loc"], *place), _statement_and_advice(text)) for place, text in cause.errors]


def describe_error(detail: ErrorDetails, model: type) -> FieldError:
    """Describe an error that pydantic found."""
    error = _describe(detail, model)
    if error.advice or detail["type"] in _SELF_EXPLANATORY:
        return error
    return error._replace(advice=description_at(model, detail["loc"]))


_SELF_EXPLANATORY = {"extra_forbidden", "value_error", "missing", "invalid_key", "too_long", "too_short"}
_SELF_EXPLANATORY |= _MAPPING_ERRORS


def _describe(detail: ErrorDetails, model: type) -> FieldError:
    kind, given, place = detail["type"], detail["input"], detail["loc"]
    if kind == "extra_forbidden" and given is None and " " in str(place[-1]):  # YAML reads `{ note: a, b c }` like this
        advice = "is it the end of a text with a comma? Put the whole text into quotation marks"
        return FieldError("unknown field without a value", advice, "unknown-field")
    if kind == "extra_forbidden":
        return FieldError("unknown field", _suggest_field(model, place), "unknown-field")
    if kind == "value_error":
        return _statement_and_advice(str(detail["ctx"]["error"]))
    if kind == "missing":
        return _missing(given, model, place)
    if kind == "invalid_key":
        return FieldError("the field's name must be text", "is there a decimal comma before it? Write 1.5, not 1,5")
    if (number_error := describe_number_error(detail)) is not None:
        return number_error
    if kind in {"too_long", "too_short"}:
        return _wrong_length(detail)
    if kind in _LIST_ERRORS:
        return _not_a_list(given, types_at(model, place))
    if kind in _MAPPING_ERRORS:
        return _not_a_mapping(given, types_at(model, place), models_at(model, place))
    if kind in _TEXT_ERRORS:
        return _not_text(detail)
    if kind == "frozen_set_type":
        return FieldError(f"expected a frozenset, got {as_written(given)}")
    if kind == "is_instance_of":
        return FieldError(f"expected a {detail['ctx']['class']}, got {as_written(given)}")
    if kind in _BOOLEAN_ERRORS:
        return FieldError(f"expected true or false, got {as_written(given)}")
    if kind in {"literal_error", "enum"}:
        expected = str(detail["ctx"]["expected"])
        near = get_close_matches(str(given), re.findall("'([^']+)'", expected), n=1, cutoff=0.6)
        advice = f"did you mean {near[0]}?" if near else f"write {expected}"
        return FieldError(f"{as_written(given)} is not allowed", advice)
    if kind == "union_tag_invalid":
        tags = str(detail["ctx"]["expected_tags"]).replace(", ", " or ")
        name = str(detail["ctx"]["discriminator"]).strip("'")
        return FieldError(f"unknown {name} {as_written(str(detail['ctx']['tag']))}", f"write {tags}")
    return FieldError(detail["msg"])


def _statement_and_advice(text: str) -> FieldError:
    statement, _, advice = text.partition(": ")
    return FieldError(statement, advice)


def _missing(given: Any, model: type, place: Location) -> FieldError:
    if isinstance(place[-1], int) and isinstance(given, list):
        wanted = max((length for expected in types_at(model, place[:-1]) for length in lengths_of(expected)), default=0)
        return FieldError(f"expected {wanted} values, got {len(given)}", description_at(model, place))
    return FieldError("required field is missing", code="missing-field")


def _wrong_length(detail: ErrorDetails) -> FieldError:
    given = detail["input"]
    if isinstance(given, list) and detail["type"] == "too_long":
        return _too_many(given, detail["ctx"]["max_length"])
    if not isinstance(given, list | frozenset) or detail["type"] == "too_long":
        return FieldError(detail["msg"])
    least = detail["ctx"]["min_length"]
    return FieldError(f"expected at least {least} {'entry' if least == 1 else 'entries'}, got {len(given)}")


def _too_many(given: list[Any], max_length: int) -> FieldError:
    statement = f"expected {max_length} values, got {len(given)}"
    return FieldError(statement, "is this a decimal comma? Write 1.5, not 1,5" if len(given) <= 2 * max_length else "")


def _not_a_list(given: Any, wanted: list[Any]) -> FieldError:
    if given is None:
        return FieldError("expected a list, got nothing", "give its entries, or omit the field if it is optional")
    count = max((length for expected in wanted for length in lengths_of(expected)), default=0)
    if not isinstance(given, str):
        advice = f"write {count} values in brackets" if count else ""
        if isinstance(given, dict) and not count:
            advice = "begin each entry with -"
        return FieldError(f"expected a list, got {as_written(given)}", advice)
    text = given.strip()[:40]
    if any(takes_text(expected) for expected in wanted) and not _NUMBERS_IN_TEXT.fullmatch(text):
        return FieldError(f"expected a list, got {text!r}", f"write [{text}]")
    example = ", ".join(("1.5", "2", "0.5")[: count or 2])
    what = "a list of coordinates" if count else "a list"
    return FieldError(f"expected {what}, got {text!r}", f"write it in brackets and without quotes, as [{example}]")


def _not_a_mapping(given: Any, wanted: list[Any], models: list[type]) -> FieldError:
    fields = ", ".join((fields_of(models, required=True) or fields_of(models))[:5])
    statement = f"expected a mapping, got {as_written(given)}"
    if any(is_mapping(expected) for expected in wanted):
        return FieldError(statement, f"give each entry a name and {fields or 'a value'}")
    return FieldError(statement, f"its fields are {fields}" if fields else "")


def _not_text(detail: ErrorDetails) -> FieldError:
    kind, given = detail["type"], detail["input"]
    is_color = str(detail["loc"][-1]).endswith("color") if detail["loc"] else False
    if kind == "string_pattern_mismatch":
        return _wrong_pattern(str(given).strip(), str(detail["ctx"]["pattern"]), is_color)
    if kind == "string_too_short":
        return FieldError("must not be empty")
    if kind == "string_too_long":
        return FieldError(f"must have at most {detail['ctx']['max_length']} characters, got {len(given)}")
    if is_color and isinstance(given, int):
        return FieldError(f"{given} is not a colour", f'write "#{given:06d}", in quotes')
    statement = f"expected text, got {as_written(given)}"
    if given is None:
        return FieldError(statement, "omit the field, or write text")
    if isinstance(given, list) and given and all(isinstance(item, int | str) for item in given):
        return FieldError(statement, f'write it in quotes: "{",".join(str(item) for item in given)[:40]}"')
    if isinstance(given, list | dict):
        return FieldError(statement)
    return FieldError(statement, f'write it in quotes: "{as_written(given)}"')


def _wrong_pattern(given: str, pattern: str, is_color: bool) -> FieldError:
    if not given:
        return FieldError("must not be empty")
    if is_color:
        hexadecimal = re.fullmatch("[0-9a-fA-F]{6}", given)
        advice = f'write "#{given}", in quotes' if hexadecimal else 'an example is "#a05a2c", in quotes'
        return FieldError(f"{given[:40]!r} is not a colour", advice)
    plain = unicodedata.normalize("NFKD", given.lower()).encode("ascii", "ignore").decode()
    tidy = re.sub(r"[^a-z0-9_-]+", "-", plain).strip("-_")
    if tidy and pattern.startswith("^[a-z0-9]") and re.fullmatch(pattern, tidy):
        return FieldError(f"{given[:40]!r} may have only lower-case letters, digits, - and _", f"write {tidy}")
    if "/" in pattern:
        return FieldError(f"{given[:40]!r} is not a valid ROS name", "use letters, digits, _ and / only")
    return FieldError(f"{given[:40]!r} has the wrong form", f"it must match {pattern}")


def _suggest_field(model: type, location: Location) -> str:
    fields = sorted(fields_of(models_at(model, location[:-1])))
    name = str(location[-1])
    near = get_close_matches(name, fields, n=1, cutoff=0.7)
    near = near or [field for field in fields if field.startswith(f"{name}_") or name.startswith(f"{field}_")]
    near = near or [field for field in fields if len(name) >= 3 and field.startswith(name)]  # pos, cat
    return f"did you mean {near[0]}?" if near else ""
