"""Reads TOML files into pydantic models, with errors that name the line and the field."""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from vsnbench.settings.field_types import Location
from vsnbench.settings.validation import InvalidSettingsError, Settings, SettingsFault, validated

_SECTION = re.compile(r"\s*\[\s*([\w.-]+)\s*\]")
_KEY = re.compile(r"\s*([\w.-]+)\s*=")


def parse_toml(
    text: str, origin: str, model: type[Settings], what: str, context: Mapping[str, Any] | None = None
) -> Settings:
    """Return the settings in TOML text; see `vsnbench.settings.validation.validated`.

    Raises:
        InvalidSettingsError: the text is not TOML, or a value is invalid.
    """
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # the message has line and column
        raise InvalidSettingsError(SettingsFault(origin, str(error), code="invalid-toml")) from error
    lines = _lines_of(text)

    def place_of(location: Location) -> tuple[Location, int]:
        for length in range(len(location), 0, -1):
            if (line := lines.get(".".join(map(str, location[:length])))) is not None:
                return location, line
        return location, 1

    return validated(content, model, what, origin, place_of, context)


def _lines_of(text: str) -> dict[str, int]:
    """Return the first line of each section and key, such as `console` and `console.port`."""
    lines: dict[str, int] = {}
    section = ""
    for number, line in enumerate(text.splitlines(), 1):
        if header := _SECTION.match(line):
            section = f"{header[1]}."
            lines.setdefault(header[1], number)
        elif key := _KEY.match(line):
            lines.setdefault(section + key[1], number)
    return lines
