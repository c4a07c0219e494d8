"""Validates the plain values of a settings file with its pydantic model; the faults name the line, field and fix."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from vsnbench.errors import VsnbenchError
from vsnbench.settings.field_errors import describe_errors
from vsnbench.settings.field_types import Location, without_types
from vsnbench.settings.number_errors import FieldError, as_written

Settings = TypeVar("Settings", bound=BaseModel)

MOST_FAULTS = 100
"""Faults that are described; each costs time in proportion to the length of the file."""


@dataclass(frozen=True, slots=True)
class SettingsFault:
    """One error in a file."""

    where: str
    """`file:line: field (name)`, as far as known, for instance `flat.yaml:3: objects.0.size_m (sofa-1)`."""
    statement: str
    advice: str = ""
    """The likely fix, or an empty string."""
    line: int | None = None
    """Line of the file, from 1."""
    path: Location = ()
    """The field: ("walls", 2, "start")."""
    code: str = "invalid-yaml"

    @property
    def problem(self) -> str:
        """The statement and the advice."""
        return self.statement + (f": {self.advice}" if self.advice else "")

    def __str__(self) -> str:
        return f"{self.where}: {self.problem}"


class InvalidSettingsError(Exception):
    """The faults of a file, at least one."""

    def __init__(self, *faults: SettingsFault, number: int = 0) -> None:
        """Keep the first faults; `number` is that of all, if more were found than are described."""
        super().__init__(str(faults[0]))
        self.faults = faults[:MOST_FAULTS]
        self.more = max(number, len(faults)) - len(self.faults)
        """Number of further faults."""

    def __str__(self) -> str:
        """Return the first fault and the number of the others."""
        others = len(self.faults) - 1 + self.more
        return f"{self.faults[0]}" + (f" (and {others} more)" if others else "")

    def as_error(self, error: type[VsnbenchError]) -> VsnbenchError:
        """Return an error with the first fault and its code."""
        return error(str(self), code=self.faults[0].code)


def validated(
    content: dict[Any, Any],
    model: type[Settings],
    what: str,
    origin: str,
    place_of: Callable[[Location], tuple[Location, int]],
    context: Mapping[str, Any] | None = None,
) -> Settings:
    """Return the settings of a file's plain values.

    Args:
        content: the values.
        model: model of the content.
        what: kind of file, for faults of the whole.
        origin: name of the file.
        place_of: returns the path of a field as the file has it, and its line.
        context: context of the model's validators.

    Raises:
        InvalidSettingsError: a value is invalid.
    """
    faults: list[SettingsFault] = []

    def add(location: Location, error: FieldError) -> None:
        path, line = place_of(location)
        where = f"{origin}:{line}: {'.'.join(map(str, path)) or what}{_name_around(content, path)}"
        faults.append(SettingsFault(where, error.statement, error.advice, line, path, error.code))

    settings: Settings | None = None
    number = 0
    try:
        settings = model.model_validate(content, context=context)
    except ValidationError as problem:
        # A misspelt field is also reported as missing under its right name; the misspelling is the useful error.
        details = sorted(problem.errors(), key=lambda detail: detail["type"] != "extra_forbidden")
        number = len(details)
        for detail in details[:MOST_FAULTS]:
            for place, described in describe_errors(detail, model):
                add(place, described)
    known = {fault.path for fault in faults}
    for path, value in islice(_non_finite_numbers(content, ()), MOST_FAULTS):
        if path not in known:
            add(path, FieldError(f"expected a finite number, got {as_written(value)}"))
    if faults or settings is None:
        raise InvalidSettingsError(*faults, number=number)
    return settings


def first_error(problem: ValidationError, model: type) -> tuple[str, FieldError]:
    """Return the field of the first error in values that are not from a file, such as `camera.width`, and the error."""
    location, error = describe_errors(problem.errors()[0], model)[0]
    return ".".join(map(str, without_types(model, location))), error


def _non_finite_numbers(content: Any, path: Location) -> Iterator[tuple[Location, float]]:
    """Yield the path and value of each NaN and infinity; no settings file may have them."""
    if isinstance(content, float) and not math.isfinite(content):
        yield path, content
    elif isinstance(content, dict):
        for name, value in content.items():
            yield from _non_finite_numbers(value, (*path, name))
    elif isinstance(content, list):
        for place, value in enumerate(content):
            yield from _non_finite_numbers(value, (*path, place))


def _name_around(content: Any, path: Location) -> str:
    """Return the name of the object, room or starting position that contains a field, in parentheses."""
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
