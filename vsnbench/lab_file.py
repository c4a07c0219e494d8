"""A lab's own defaults, `vsnbench.toml`: after a flag and the environment, before what vsnbench takes by itself."""

import os
import tomllib
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from pathlib import Path

from vsnbench.errors import UsageError

FILE_NAME = "vsnbench.toml"
VARIABLE_OF: Mapping[str, str] = {
    "site": "VSNBENCH_SITE",
    "robot": "VSNBENCH_ROBOT",
    "results": "VSNBENCH_RESULTS",
    "operator": "VSNBENCH_OPERATOR",
    "weights": "VSNBENCH_WEIGHTS",
}
"""What the file may say, and the variable of the environment that says the same."""
BUILT_IN_SITE = "apartment"
BUILT_IN_ROBOT = "simulated"
BUILT_IN_RESULTS = "results"
CHECKED_ROBOT = "turtlebot2"
"""What holds where nobody says a site, a robot or a results directory; and the robot that `doctor` looks at then."""
_PATHS = {"site", "results", "weights"}


@dataclass(frozen=True, slots=True)
class LabDefault:
    """One default of a lab."""

    name: str
    value: str
    source: str
    """The file or the variable that says it; empty where nobody does."""


def find_lab_file(directory: Path) -> Path | None:
    """Return the nearest `vsnbench.toml` in a directory or above it; None without one."""
    return next((file for place in (directory, *directory.parents) if (file := place / FILE_NAME).is_file()), None)


def read_lab_file(file: Path) -> dict[str, str]:
    """Return what a lab's file says; paths in it are beside it.

    Raises:
        UsageError: it cannot be read, is no TOML, or says what it may not.
    """
    try:
        said = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # no UTF-8, or no TOML: the message has line and column
        raise UsageError(f"{file}: {error}") from error
    for name, value in said.items():
        if name not in VARIABLE_OF:
            raise UsageError(f"{file}: {name!r} is no default", advice=f"it may say {', '.join(VARIABLE_OF)}")
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise UsageError(f'{file}: {name} must be text in quotes: {name} = "..."')
    return {name: _beside(file, name, value) if name in _PATHS else value for name, value in said.items()}


def lab_defaults(directory: Path | None = None, environment: Mapping[str, str] = os.environ) -> list[LabDefault]:
    """Return every default that a lab can have, with what says it.

    Args:
        directory: where a command was typed; the working directory when left out.
        environment: the environment's variables.

    Raises:
        UsageError: there is a file that cannot be read, or says what it may not.
    """
    file = find_lab_file(directory or Path.cwd())
    said = read_lab_file(file) if file else {}
    found = []
    for name, variable in VARIABLE_OF.items():
        if value := environment.get(variable):
            found.append(LabDefault(name, value, variable))
        elif name in said:
            found.append(LabDefault(name, said[name], str(file)))
        else:
            found.append(LabDefault(name, "", ""))
    return found


def take_lab_defaults(environment: MutableMapping[str, str] = os.environ) -> list[LabDefault]:
    """Put what the lab's file says into the environment, where the environment does not say it; return just that.

    Processes that are started from here then find the same.

    Raises:
        UsageError: there is a file that cannot be read, or says what it may not.
    """
    file = find_lab_file(Path.cwd())
    taken = []
    for default in lab_defaults(environment=environment):
        if file is not None and default.source == str(file):
            environment[VARIABLE_OF[default.name]] = default.value
            taken.append(default)
    return taken


def _beside(file: Path, name: str, value: str) -> str:
    """Return a path in a file as seen from the working directory; a site that is no file is an embedded one's name."""
    if file.parent == Path.cwd() or (name == "site" and not value.endswith((".yaml", ".yml"))):
        return value
    return str(file.parent / Path(value).expanduser())
