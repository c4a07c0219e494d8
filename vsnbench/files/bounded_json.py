"""JSON of unknown origin: integers that are too long become infinite, which loaders reject."""

import json
import re
from typing import Any

LONGEST_INTEGER = 40
"""Maximum number of digits of an integer. Longer ones are read as floating-point numbers: Python's integers have no
limit, and converting one of 400 digits later raises OverflowError.
"""
_LONG_INTEGER = re.compile(rf"\d{{{LONGEST_INTEGER + 1}}}")


def parse_json(text: str | bytes) -> Any:
    """Return the value of a JSON text; bytes are UTF-8.

    Raises:
        ValueError: the text is not JSON.
        RecursionError: the text is nested too deeply.
    """
    if isinstance(text, bytes):
        text = text.decode("utf-8")
    if _LONG_INTEGER.search(text) is None:  # the usual case, which C code reads completely
        return json.loads(text)
    return json.loads(text, parse_int=_integer)


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)
