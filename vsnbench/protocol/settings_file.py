"""Reads a YAML file into a pydantic model, with errors that name the line and the field."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vsnbench.errors import VsnbenchError

Settings = TypeVar("Settings", bound=BaseModel)


def read_settings(path: Path, model: type[Settings], error: type[VsnbenchError], what: str) -> Settings:
    """Read a file; see `parse_settings`.

    Raises:
        VsnbenchError: the file cannot be read or breaks the format; of the class `error`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as problem:
        raise error(f"cannot read {what} file {path}: {problem.strerror or problem}") from problem
    except UnicodeDecodeError as problem:
        raise error(f"cannot read {what} file {path}: it is no text in UTF-8") from problem
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
    tree, content = _read_yaml(text, origin, error)
    if not isinstance(content, dict):
        required = [name for name, field in model.model_fields.items() if field.is_required()]
        fields = ", ".join(required or model.model_fields)
        raise error(f"{origin}:1: a {what} file is a mapping with {fields}")
    try:
        return model.model_validate(content)
    except ValidationError as problem:
        # A misspelt field is missing under its right name too: the misspelling is what helps.
        worst = min(problem.errors(), key=lambda one: one["type"] != "extra_forbidden")
        field = ".".join(str(part) for part in worst["loc"]) or what
        more = f" (and {problem.error_count() - 1} more)" if problem.error_count() > 1 else ""
        raise error(f"{origin}:{_line_of(tree, worst['loc'])}: {field}: {_words(worst)}{more}") from problem


def _read_yaml(text: str, origin: str, error: type[VsnbenchError]) -> tuple[yaml.Node | None, Any]:
    """Return the tree with its lines, and the plain values."""
    try:
        loader = yaml.SafeLoader(text)
        tree = loader.get_single_node()
        for key in _keys_given_twice(tree, set()):
            raise error(f"{origin}:{key.start_mark.line + 1}: {key.value} is given twice in the same place")
        return tree, None if tree is None else loader.construct_document(tree)
    except yaml.reader.ReaderError as problem:
        line = text.count("\n", 0, problem.position) + 1
        raise error(f"{origin}:{line}: not valid YAML: a control character") from problem
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark
        where = f"{origin}:{mark.line + 1}" if mark else origin
        raise error(f"{where}: not valid YAML: {problem.problem or problem.context}") from problem
    except (yaml.YAMLError, ValueError, RecursionError) as problem:
        # A date with 99 days, a number of 5,000 digits, brackets 1,000 deep.
        reason = "too many levels" if isinstance(problem, RecursionError) else problem
        raise error(f"{origin}: not valid YAML: {reason}") from problem


def _keys_given_twice(node: yaml.Node | None, seen: set[int]) -> Iterator[yaml.Node]:
    """Walk the tree for keys that YAML would quietly let win over their first mention."""
    if node is None or id(node) in seen:  # an alias leads to a node that has been looked at, or to one around it
        return
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            yield from _keys_given_twice(item, seen)
    elif isinstance(node, yaml.MappingNode):
        names: set[str] = set()
        for key, value in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in names:
                    yield key
                names.add(key.value)
            yield from _keys_given_twice(value, seen)


def _words(detail: ErrorDetails) -> str:
    """Say what is wrong with a field in a line: our own validators' words, else pydantic's."""
    if detail["type"] == "extra_forbidden":
        return "there is no such field"
    if detail["type"] == "value_error":
        return str(detail["ctx"]["error"])
    return detail["msg"]


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
