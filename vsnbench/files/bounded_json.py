"""JSON of unknown origin: integers that are too long become infinite, which loaders reject."""

import json
import re
from collections.abc import Callable
from typing import Any

LONGEST_INTEGER = 40
"""Maximum number of digits of an integer. Longer ones are read as floating-point numbers: Python's integers have no
limit, and converting one of 400 digits later raises OverflowError.
"""
_LONG_INTEGER = re.compile(rf"\d{{{LONGEST_INTEGER + 1}}}")


def parse_json(text: str | bytes, parse_constant: Callable[[str], Any] | None = None) -> Any:
    """Return the value of a JSON text.

    Args:
        text: the JSON text, in UTF-8 if it is bytes.
        parse_constant: returns the value of `NaN`, `Infinity` and `-Infinity`.

    Raises:
        ValueError: the text is not JSON.
        RecursionError: the text is nested too deeply.
    """
    if isinstance(text, bytes):
        text = text.decode("utf-8")
    if _LONG_INTEGER.search(text) is None:  # the usual case, which C code reads completely
        return json.loads(text, parse_constant=parse_constant)
    return json.loads(text, parse_int=_integer, parse_constant=parse_constant)


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)
