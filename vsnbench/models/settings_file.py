"""Reads a model's settings (`--model-config FILE`) from YAML; errors name the line and the field."""

from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from vsnbench.errors import UsageError

Settings = TypeVar("Settings", bound=BaseModel)


def read_settings(path: Path | None, kind: type[Settings]) -> Settings:
    """Return the settings in a YAML file, or the defaults when there is no file.

    Raises:
        UsageError: the file cannot be read, is no YAML mapping, or a setting is unknown or out of range.
    """
    if path is None:
        return kind()
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read model settings {path}: {error}") from error
    try:
        tree = yaml.compose(text, Loader=yaml.SafeLoader)
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark else str(path)
        raise UsageError(f"{where}: not valid YAML: {getattr(error, 'problem', None) or 'unreadable'}") from error
    if content is None:
        return kind()
    known = ", ".join(kind.model_fields)
    if not isinstance(content, dict):
        raise UsageError(f"{path}:1: model settings are a mapping of {known}")
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        field = str(first["loc"][0]) if first["loc"] else "settings"
        problem = f"unknown; known are {known}" if first["type"] == "extra_forbidden" else first["msg"]
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise UsageError(f"{path}:{_line_of(tree, field)}: {field}: {problem}{more}") from error


def _line_of(tree: yaml.Node | None, field: str) -> int:
    """Return the 1-based line on which a top-level field stands."""
    if isinstance(tree, yaml.MappingNode):
        for key, _ in tree.value:
            if key.value == field:
                return int(key.start_mark.line) + 1
    return 1
