"""Reads a YAML file into a pydantic model, with errors that name the line and the field; bounded in size and depth."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from vsnbench.errors import VsnbenchError
from vsnbench.protocol.field_faults import words_of
from vsnbench.protocol.number_faults import as_written

Settings = TypeVar("Settings", bound=BaseModel)

MOST_CHARACTERS = 2_000_000
"""Longer files are refused: a site of a thousand objects has a twentieth of it."""
MOST_VALUES = 250_000
"""More values, aliases and merge keys (`<<`) followed, are refused before they are made."""


@dataclass(frozen=True, slots=True)
class SettingsFault:
    """One thing that is wrong with a file."""

    where: str
    """`file:line: field`, or as much of it as is known; with what its object is called: `objects.0.size_m (sofa-1)`."""
    statement: str
    mend: str = ""
    """What to write in its place; empty where nothing better is known than the statement."""
    line: int | None = None
    """Where in the file, from 1."""
    path: tuple[int | str, ...] = ()
    """The field: ("walls", 2, "start")."""

    @property
    def problem(self) -> str:
        """What is wrong, and what to do."""
        return self.statement + (f": {self.mend}" if self.mend else "")

    def __str__(self) -> str:
        return f"{self.where}: {self.problem}"


class _FaultyError(Exception):
    def __init__(self, *faults: SettingsFault) -> None:
        super().__init__(str(faults[0]))
        self.faults = faults


def read_settings(path: Path, model: type[Settings], error: type[VsnbenchError], what: str) -> Settings:
    """Read a file; see `parse_settings`.

    Raises:
        VsnbenchError: the file cannot be read or breaks the format; of the class `error`.
    """
    return parse_settings(_text_of(path, error, what), str(path), model, error, what)


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
        return _parse(text, origin, model, what)
    except _FaultyError as faulty:
        more = f" (and {len(faulty.faults) - 1} more)" if len(faulty.faults) > 1 else ""
        raise error(f"{faulty.faults[0]}{more}") from faulty


CHECKING = "checking"
"""In the context of validation: somebody asked for everything that is wrong, also what loading takes as it is."""


def settings_faults(path: Path, model: type[BaseModel], error: type[VsnbenchError], what: str) -> list[SettingsFault]:
    """Return everything in which a file breaks its format; empty for a good one.

    Raises:
        VsnbenchError: the file cannot be read; of the class `error`.
    """
    return text_faults(_text_of(path, error, what), str(path), model, what)


def parse_plain(text: str, origin: str, error: type[VsnbenchError], what: str) -> dict[str, Any]:
    """Read YAML text with a mapping in it, whatever its fields; bounded as every settings file is.

    Raises:
        VsnbenchError: it is none; of the class `error`; the message names the line.
    """
    try:
        _, content = _read_yaml(text, origin)
    except _FaultyError as faulty:
        raise error(str(faulty.faults[0])) from faulty
    if not isinstance(content, dict):
        raise error(f"{origin}: a {what} file is a mapping")
    return content


def text_faults(text: str, origin: str, model: type[BaseModel], what: str) -> list[SettingsFault]:
    """Return everything in which a text breaks its format; empty for a good one."""
    try:
        _parse(text, origin, model, what, checking=True)
    except _FaultyError as faulty:
        return list(faulty.faults)
    return []


def _text_of(path: Path, error: type[VsnbenchError], what: str) -> str:
    try:
        with path.open(encoding="utf-8") as file:
            return file.read(MOST_CHARACTERS + 1)
    except OSError as problem:
        raise error(f"cannot read {what} file {path}: {problem.strerror or problem}") from problem
    except UnicodeDecodeError as problem:
        raise error(f"cannot read {what} file {path}: it is no text in UTF-8") from problem


def _parse(text: str, origin: str, model: type[Settings], what: str, *, checking: bool = False) -> Settings:
    tree, content = _read_yaml(text, origin)
    if not isinstance(content, dict):
        required = [name for name, field in model.model_fields.items() if field.is_required()]
        fields = ", ".join(required or model.model_fields)
        raise _FaultyError(SettingsFault(f"{origin}:1", f"a {what} file is a mapping with {fields}"))
    faults: list[SettingsFault] = []
    settings: Settings | None = None
    try:
        settings = model.model_validate(content, context={CHECKING: checking})
    except ValidationError as problem:
        # A misspelt field is missing under its right name too: the misspelling is what helps.
        for one in sorted(problem.errors(), key=lambda one: one["type"] != "extra_forbidden"):
            path = _written_path(tree, one["loc"])
            line = _line_of(tree, path)
            where = f"{origin}:{line}: {'.'.join(map(str, path)) or what}{_called(content, path)}"
            faults.append(SettingsFault(where, *words_of(one, model), line, path))
    known = {fault.path for fault in faults}
    for path, number in _endless(content, ()):
        if path not in known:
            line = _line_of(tree, path)
            where = f"{origin}:{line}: {'.'.join(map(str, path))}{_called(content, path)}"
            faults.append(SettingsFault(where, f"{as_written(number)} is no number", "write one", line, path))
    if faults or settings is None:
        raise _FaultyError(*faults)
    return settings


def _endless(content: Any, path: tuple[int | str, ...]) -> Iterator[tuple[tuple[int | str, ...], float]]:
    """Yield where numbers stand that are none, or infinite: nothing in a settings file may be so."""
    if isinstance(content, float) and not math.isfinite(content):
        yield path, content
    elif isinstance(content, dict):
        for name, value in content.items():
            yield from _endless(value, (*path, name))
    elif isinstance(content, list):
        for place, value in enumerate(content):
            yield from _endless(value, (*path, place))


def _called(content: Any, path: tuple[int | str, ...]) -> str:
    """Return the innermost name on the way to a field, in brackets: that of an object, a room, a starting position."""
    name = ""
    for part in path[:-1]:
        try:
            content = content[part]
        except (LookupError, TypeError):
            break
        if isinstance(part, int) and isinstance(content, dict):
            key = next((key for key in ("id", "name", "number") if isinstance(content.get(key), str | int)), "")
            name = f"{'number ' * (key == 'number')}{content[key]}"[:40] if key and key != path[-1] else ""
    return f" ({name})" if name.isprintable() and name else ""


def _read_yaml(text: str, origin: str) -> tuple[Node | None, Any]:
    """Return the tree with its lines, and the plain values."""

    def faulty(problem: str, line: int | None = None) -> _FaultyError:
        return _FaultyError(SettingsFault(origin if line is None else f"{origin}:{line}", problem, line=line))

    if len(text) > MOST_CHARACTERS:
        raise faulty(f"longer than {MOST_CHARACTERS:,} characters")
    yaml = YAML(typ="safe", pure=True)
    try:
        tree = yaml.compose(text)
        twice = [
            SettingsFault(f"{origin}:{key.start_mark.line + 1}", f"{key.value} is given twice in the same place")
            for key in _keys_given_twice(tree, set())
        ]
        if twice:
            raise _FaultyError(*twice)
        if tree is None:
            return None, None
        if _count_values(tree, {}) > MOST_VALUES:
            raise faulty(f"aliases and merge keys make more than {MOST_VALUES:,} values of it: write fewer")
        return tree, yaml.constructor.construct_document(tree)
    except ReaderError as problem:
        line = text.count("\n", 0, problem.position) + 1
        raise faulty("not valid YAML: a control character", line) from problem
    except MarkedYAMLError as problem:
        mark = problem.problem_mark
        reason = str(problem.problem or problem.context).splitlines()[0]
        raise faulty(f"not valid YAML: {reason}", mark.line + 1 if mark else None) from problem
    except RecursionError as problem:
        raise faulty("not valid YAML: too many levels") from problem
    except (YAMLError, ValueError, ArithmeticError, AttributeError, TypeError, KeyError) as problem:
        # A date with 99 days, a number of 5,000 digits, a key that is a list, a tag for another kind of value.
        reason = (str(problem).splitlines() or [type(problem).__name__])[0]
        raise faulty(f"not valid YAML: {reason}") from problem


def _count_values(node: Node, known: dict[int, int]) -> int:
    """Return how many values a node makes with every alias followed; an alias inside itself counts as too many."""
    if id(node) not in known:
        known[id(node)] = MOST_VALUES + 1
        if isinstance(node, MappingNode):
            parts = [part for pair in node.value for part in pair]
        else:
            parts = list(node.value) if isinstance(node, SequenceNode) else []
        known[id(node)] = 1 + sum(_count_values(part, known) for part in parts)
    return known[id(node)]


def _keys_given_twice(node: Node | None, seen: set[int]) -> Iterator[Node]:
    """Walk the tree for keys that YAML would quietly let win over their first mention."""
    if node is None or id(node) in seen:  # an alias leads to a node that has been looked at, or to one around it
        return
    seen.add(id(node))
    if isinstance(node, SequenceNode):
        for item in node.value:
            yield from _keys_given_twice(item, seen)
    elif isinstance(node, MappingNode):
        names: set[str] = set()
        for key, value in node.value:
            if isinstance(key, ScalarNode):
                if key.value in names:
                    yield key
                names.add(key.value)
            yield from _keys_given_twice(value, seen)


def _written_path(node: Node | None, location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return a location without the tag that chose between kinds, which is in no file: interface.ros2.odometry."""
    if isinstance(node, MappingNode) and len(location) >= 3 and isinstance(location[1], str):
        inner = next((value for key, value in node.value if key.value == location[0]), None)
        values = {key.value: value.value for key, value in inner.value} if isinstance(inner, MappingNode) else {}
        if location[1] not in values and location[1] in values.values():
            return (location[0], *location[2:])
    return location


def _line_of(node: Node | None, location: tuple[int | str, ...]) -> int:
    """Return the 1-based line of the deepest node on the way to `location`."""
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
