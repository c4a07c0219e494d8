"""Reads YAML files into pydantic models, with errors that name the line and the field, and with size limits."""

import io
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from vsnbench.errors import VsnbenchError
from vsnbench.files.bounded_json import LONGEST_INTEGER
from vsnbench.files.regular import open_regular
from vsnbench.settings.field_types import Location
from vsnbench.settings.validation import InvalidSettingsError, Settings, SettingsFault, validated

MAX_CHARACTERS = 2_000_000
"""Maximum length of a file; a site of a thousand objects has a twentieth of it."""
MAX_VALUES = 250_000
"""Maximum number of values after expansion of aliases and merge keys (`<<`)."""
MAX_SEPARATORS = 100_000
"""Maximum number of line ends, colons, commas and hyphens. The parser takes 5 s for them; a site of a thousand objects
has a fifth."""


def read_settings(path: Path, model: type[Settings], error: type[VsnbenchError], what: str) -> Settings:
    """Read a file; see `parse_settings`.

    Raises:
        VsnbenchError: the file cannot be read or breaks the format; of the class `error`.
    """
    return parse_settings(_text_of(path, error, what), str(path), model, error, what, path.parent)


def parse_settings(
    text: str, origin: str, model: type[Settings], error: type[VsnbenchError], what: str, directory: Path | None = None
) -> Settings:
    """Read YAML text.

    Args:
        text: content of the file.
        origin: name of the file for errors.
        model: model of the content.
        error: class of the errors to raise.
        what: kind of file for errors, for instance "site".
        directory: directory of the file, which paths in it are relative to; None if there is no file.

    Raises:
        VsnbenchError: the text breaks the format; of the class `error`, with the code of the first fault
            (`invalid-yaml`, `unknown-field`, `missing-field`, `invalid-field`).
    """
    try:
        return _parse(text, origin, model, what, {DIRECTORY: directory})
    except InvalidSettingsError as invalid:
        raise invalid.as_error(error) from invalid


CHECKING = "checking"
"""Key of the validation context: true if validators also report what loading accepts."""
DIRECTORY = "directory"
"""Key of the validation context: directory of the file; None or absent if there is no file."""


def settings_faults(path: Path, model: type[BaseModel], error: type[VsnbenchError], what: str) -> list[SettingsFault]:
    """Return the first faults of a file, and their number if there are more than MOST_FAULTS.

    Raises:
        VsnbenchError: the file cannot be read; of the class `error`.
    """
    return text_faults(_text_of(path, error, what), str(path), model, what, path.parent)


def parse_plain(text: str, origin: str, error: type[VsnbenchError], what: str) -> dict[str, Any]:
    """Read YAML text of a mapping with any fields, within the limits of settings files.

    Raises:
        VsnbenchError: the text is not valid; of the class `error`.
    """
    try:
        _, content = _read_yaml(text, origin)
    except InvalidSettingsError as invalid:
        raise invalid.as_error(error) from invalid
    if not isinstance(content, dict):
        raise error(f"{origin}: a {what} file must be a mapping", code="invalid-yaml")
    return content


def text_faults(
    text: str, origin: str, model: type[BaseModel], what: str, directory: Path | None = None
) -> list[SettingsFault]:
    """Return the first faults of a text, and their number if there are more than MOST_FAULTS; see `parse_settings`."""
    try:
        _parse(text, origin, model, what, {CHECKING: True, DIRECTORY: directory})
    except InvalidSettingsError as invalid:
        rest = [SettingsFault(origin, f"{invalid.more:,} more errors", code=invalid.faults[0].code)]
        return [*invalid.faults, *(rest if invalid.more else [])]
    return []


def _text_of(path: Path, error: type[VsnbenchError], what: str) -> str:
    try:
        with io.TextIOWrapper(open_regular(path), encoding="utf-8") as file:
            return file.read(MAX_CHARACTERS + 1)
    except OSError as problem:
        reason = problem.strerror or problem
        raise error(f"cannot read {what} file {path}: {reason}", code="unreadable-file") from problem
    except UnicodeDecodeError as problem:
        raise error(f"cannot read {what} file {path}: it is not UTF-8 text", code="unreadable-file") from problem


def _parse(text: str, origin: str, model: type[Settings], what: str, context: dict[str, Any]) -> Settings:
    tree, content = _read_yaml(text, origin)
    if not isinstance(content, dict):
        required = [name for name, field in model.model_fields.items() if field.is_required()]
        fields = ", ".join(required or model.model_fields)
        raise InvalidSettingsError(
            SettingsFault(f"{origin}:1", f"a {what} file must be a mapping with {fields}", line=1)
        )

    def place_of(location: Location) -> tuple[Location, int]:
        path = _written_path(tree, location)
        return path, _line_of(tree, path)

    return validated(content, model, what, origin, place_of, context)


_KEPT_CHARACTERS = 100_000
"""Length up to which the values of a text are kept in memory."""


def _read_yaml(text: str, origin: str) -> tuple[Node | None, Any]:
    """Return the node tree, which has the lines, and the plain values.

    The last texts are kept: a command reads its site several times, and the apartment takes 30 ms.
    """
    try:
        tree, content = (_parse_kept if len(text) <= _KEPT_CHARACTERS else _parse_yaml)(text)
    except InvalidSettingsError as invalid:
        raise InvalidSettingsError(
            *(replace(fault, where=f"{origin}{fault.where}") for fault in invalid.faults),
            number=len(invalid.faults) + invalid.more,
        ) from invalid.__cause__
    return tree, deepcopy(content)


def _parse_yaml(text: str) -> tuple[Node | None, Any]:
    """Return tree and values; faults say `:line`, without the name of the file."""

    def invalid(problem: str, line: int | None = None) -> InvalidSettingsError:
        return InvalidSettingsError(SettingsFault("" if line is None else f":{line}", problem, line=line))

    if len(text) > MAX_CHARACTERS:
        raise invalid(f"longer than {MAX_CHARACTERS:,} characters")
    if sum(map(text.count, "\n:,-")) > MAX_SEPARATORS:
        raise invalid(f"more than {MAX_SEPARATORS:,} lines, fields and entries of lists")
    yaml = YAML(typ="safe", pure=True)
    try:
        tree = yaml.compose(text)
        if tree is None:
            return None, None
        if repeated := [
            SettingsFault(f":{line}", f"field {name} is repeated", line=line) for line, name in _repeated_keys(tree)
        ]:
            raise InvalidSettingsError(*repeated)
        if long := [
            SettingsFault(f":{line}", f"a number has {digits} digits", line=line)
            for line, digits in _long_integers(tree)
        ]:
            raise InvalidSettingsError(*long)
        if _count_values(tree, {}) > MAX_VALUES:
            raise invalid(f"aliases and merge keys expand to more than {MAX_VALUES:,} values")
        return tree, yaml.constructor.construct_document(tree)
    except ReaderError as problem:
        line = text.count("\n", 0, problem.position) + 1
        raise invalid("not valid YAML: a control character", line) from problem
    except MarkedYAMLError as problem:
        mark = problem.problem_mark
        reason = str(problem.problem or problem.context).splitlines()[0]
        raise invalid(f"not valid YAML: {reason}", mark.line + 1 if mark else None) from problem
    except RecursionError as problem:
        raise invalid("not valid YAML: too many levels") from problem
    except (YAMLError, ValueError, ArithmeticError, AttributeError, TypeError, KeyError) as problem:
        # A date with 99 days, a number of 5,000 digits, a key that is a list, a tag for another type.
        reason = (str(problem).splitlines() or [type(problem).__name__])[0]
        raise invalid(f"not valid YAML: {reason}") from problem


_parse_kept = lru_cache(maxsize=32)(_parse_yaml)


def _count_values(node: Node, known: dict[int, int]) -> int:
    """Return the number of values after expansion of aliases; an alias inside itself exceeds the limit."""
    if id(node) not in known:
        known[id(node)] = MAX_VALUES + 1
        known[id(node)] = 1 + sum(_count_values(part, known) for part in _parts(node))
    return known[id(node)]


def _parts(node: Node) -> list[Node]:
    """Return the entries of a list, or the keys and values of a mapping."""
    if isinstance(node, MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def _nodes(tree: Node) -> Iterator[Node]:
    """Yield every node once, in the order of the text; an alias leads to a node that was visited or contains it."""
    seen: set[int] = set()
    left = [tree]
    while left:
        node = left.pop()
        if id(node) not in seen:
            seen.add(id(node))
            yield node
            left += reversed(_parts(node))


def _long_integers(tree: Node) -> list[tuple[int, int]]:
    """Return the line and the number of digits of each integer that is too long for a floating-point number."""
    return [
        (node.start_mark.line + 1, len(node.value))
        for node in _nodes(tree)
        if isinstance(node, ScalarNode) and str(node.tag).endswith(":int") and len(node.value) > LONGEST_INTEGER
    ]


def _repeated_keys(tree: Node) -> list[tuple[int, str]]:
    """Return the line and the name of each key that repeats one of its mapping; YAML would silently take the last."""
    repeated: list[tuple[int, str]] = []
    for node in _nodes(tree):
        names: set[str] = set()
        for key, _ in node.value if isinstance(node, MappingNode) else ():
            if isinstance(key, ScalarNode):
                if key.value in names:
                    repeated.append((key.start_mark.line + 1, key.value))
                names.add(key.value)
    return sorted(repeated)


def _written_path(node: Node | None, location: Location) -> Location:
    """Return a location without the tag of a tagged union, as in interface.ros2.odometry: no file has it."""
    if isinstance(node, MappingNode) and len(location) >= 3 and isinstance(location[1], str):
        inner = next((value for key, value in node.value if key.value == location[0]), None)
        values = {key.value: value.value for key, value in inner.value} if isinstance(inner, MappingNode) else {}
        if location[1] not in values and location[1] in values.values():
            return (location[0], *location[2:])
    return location


def _line_of(node: Node | None, location: Location) -> int:
    """Return the line, from 1, of the deepest node on the path to `location`."""
    line = 1
    for part in location:
        found: Node | None = None
        if isinstance(node, MappingNode):
            for key, value in node.value:
                if key.value == part:
                    found, line = value, key.start_mark.line + 1
        elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
            found = node.value[part]
            line = found.start_mark.line + 1
        if found is None:
            break
        node = found
    return line
