"""Reads a YAML file into a pydantic model, with errors that name the line and the field."""

from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from vsnbench.errors import VsnbenchError

Settings = TypeVar("Settings", bound=BaseModel)


def read_settings(path: Path, model: type[Settings], error: type[VsnbenchError], what: str) -> Settings:
    """Read a file; see `parse_settings`.

    Raises:
        VsnbenchError: the file cannot be read or breaks the format; of the class `error`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise error(f"cannot read {what} file {path}: {problem}") from problem
    return parse_settings(text, str(path), model, error, what)


def parse_settings(text: str, origin: str, model: type[Settings], error: type[VsnbenchError], what: str) -> Settings:
    """Read YAML text.

    Args:
        text: the file's content.
        origin: names the file in errors.
        model: what it has to be.
        error: the class of errors to raise.
        what: what the file is, in a word, for errors.

    Raises:
        VsnbenchError: the text breaks the format; of the class `error`; the message names the line and the field.
    """
    try:
        tree = yaml.compose(text, Loader=yaml.SafeLoader)
        content = yaml.safe_load(text)
    except yaml.YAMLError as problem:
        mark = getattr(problem, "problem_mark", None)
        where = f"{origin}:{mark.line + 1}" if mark else origin
        reason = getattr(problem, "problem", None) or "not YAML"
        raise error(f"{where}: not valid YAML: {reason}") from problem
    if not isinstance(content, dict):
        required = [name for name, field in model.model_fields.items() if field.is_required()]
        fields = ", ".join(required or model.model_fields)
        raise error(f"{origin}:1: a {what} file is a mapping with {fields}")
    try:
        return model.model_validate(content)
    except ValidationError as problem:
        first = problem.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or what
        more = f" (and {problem.error_count() - 1} more)" if problem.error_count() > 1 else ""
        raise error(f"{origin}:{_line_of(tree, first['loc'])}: {field}: {first['msg']}{more}") from problem


def _line_of(node: yaml.Node | None, location: tuple[int | str, ...]) -> int:
    """Return the 1-based line of the deepest node on the way to `location`."""
    line = 1
    for part in location:
        found: yaml.Node | None = None
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if key.value == part:
                    found, line = value, key.start_mark.line + 1
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            found = node.value[part]
            line = found.start_mark.line + 1
        if found is None:
            break
        node = found
    return line
