"""User configuration, `vsnbench.toml`: values for what a command line and the environment leave out.

The file is searched upward from the working directory, where other users may have put one. A file that others could
have written is refused, and an interpreter is taken from the working directory's own file only.
"""

import os
import shlex
import tomllib
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vsnbench.errors import UsageError
from vsnbench.files.ownership import writers_other_than_us

if TYPE_CHECKING:
    from vsnbench.settings.user_config import UserConfig

FILE_NAME = "vsnbench.toml"
VARIABLE_OF: Mapping[str, str] = {
    "site": "VSNBENCH_SITE",
    "robot": "VSNBENCH_ROBOT",
    "protocol": "VSNBENCH_PROTOCOL",
    "results": "VSNBENCH_RESULTS",
    "operator": "VSNBENCH_OPERATOR",
    "weights": "VSNBENCH_WEIGHTS",
}
"""Top-level key of the file -> environment variable with the same meaning."""
BUILT_IN_SITE = "apartment"
BUILT_IN_ROBOT = "simulated"
BUILT_IN_PROTOCOL = "ros4vsn"
BUILT_IN_RESULTS = "results"


@dataclass(frozen=True, slots=True)
class ConfigDefault:
    """Value of a top-level key, and where it comes from."""

    name: str
    value: str
    source: str
    """Path of the file or name of the variable; empty if neither sets it."""


def find_config_file(directory: Path) -> Path | None:
    """Return the nearest `vsnbench.toml` in a directory or above it, or None.

    Raises:
        UsageError: others could have written it.
    """
    files = (place / FILE_NAME for place in (directory, *directory.parents))
    file = next((file for file in files if os.path.isfile(file)), None)  # noqa: PTH113 - False for what is not ours
    if file is not None:
        _check_writers(file, directory)
    return file


def _check_writers(file: Path, directory: Path) -> None:
    """Refuse a file that other users could have written, with the keys that it would have set."""
    try:
        writers = writers_other_than_us(file)
    except OSError as error:
        raise _unreadable(file, error.strerror) from error
    if not writers:
        return
    advice = "if you trust it, make it and its directory yours alone with chown and chmod go-w"
    if file.parent != directory:
        advice = f"create a {FILE_NAME} of your own, which can be empty, in {directory}; {advice}"
    raise UsageError(f"{writers}, so {_keys_of(file)} not used", advice=advice, code="untrusted-config")


def _keys_of(file: Path) -> str:
    """Return the known keys that a file sets, as the subject of a statement."""
    from vsnbench.settings.user_config import UserConfig

    try:
        with file.open("rb") as opened:
            content = tomllib.loads(opened.read(2**16).decode())
    except (OSError, ValueError, RecursionError):
        content = {}
    keys = [name for name in VARIABLE_OF if name in content]
    for section, model in UserConfig.sections().items():
        table = content.get(section)
        if isinstance(table, dict):
            keys += [f"{section}.{key}" for key in model.model_fields if key in table]
    return f"its {', '.join(keys)} {'is' if len(keys) == 1 else 'are'}" if keys else "it is"


def isolation_interpreter(directory: Path | None = None) -> Path | None:
    """Return `[isolation] python` of a directory's own file; None if it is not set.

    Raises:
        UsageError: it is set by a file above the directory; or as `load_config`.
    """
    directory = directory or Path.cwd()
    config = load_config(directory)
    if config.file is None or config.isolation.python is None or config.file.parent == directory:
        return config.isolation.python
    raise UsageError(
        f"isolation.python in {config.file} is not used below its directory, because it names a program to run",
        advice=f"write --isolate {shlex.quote(str(config.isolation.python))}, or run the command in "
        f"{config.file.parent}",
        code="interpreter-above",
    )


def same_file_above(file: Path) -> Path | None:
    """Return the file of the same relative path in the nearest parent of the working directory.

    None for an absolute path, and if no parent has such a file.
    """
    if file.is_absolute():
        return None
    return next((found for parent in Path.cwd().parents if (found := parent / file).is_file()), None)


def load_config(directory: Path | None = None) -> "UserConfig":
    """Return the configuration for a directory (default: the working directory).

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    from vsnbench.settings.user_config import UserConfig

    file = find_config_file(directory or Path.cwd())
    return UserConfig() if file is None else read_config_file(file)


def read_config_file(file: Path) -> "UserConfig":
    """Read a `vsnbench.toml`. Relative paths are relative to the file.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    from vsnbench.settings.user_config import UserConfig
    from vsnbench.settings.validation import InvalidSettingsError

    try:
        return UserConfig.of_text(file.read_text(encoding="utf-8"), file)
    except OSError as error:
        raise _unreadable(file, error.strerror) from error
    except UnicodeDecodeError as error:
        raise _unreadable(file, "it is not UTF-8 text") from error
    except InvalidSettingsError as invalid:
        unknown = invalid.faults[0].code == "unknown-field"
        raise UsageError(str(invalid), code="unknown-config-key" if unknown else "invalid-config") from invalid


def config_defaults(directory: Path | None = None, environment: Mapping[str, str] = os.environ) -> list[ConfigDefault]:
    """Return every top-level key with its value and source, for a directory (default: the working directory).

    Environment variables override the file.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    from vsnbench.settings.user_config import seen_from_here

    config = load_config(directory)
    found = []
    for name, variable in VARIABLE_OF.items():
        given: str | None = getattr(config, name)
        if value := environment.get(variable):
            found.append(ConfigDefault(name, value, variable))
        elif given is not None:
            found.append(ConfigDefault(name, given, str(config.file)))
        elif name == "results" and config.file is not None and config.file.parent != (directory or Path.cwd()):
            # The results directory is next to the file, in whichever subdirectory a command runs.
            found.append(ConfigDefault(name, seen_from_here(config.file, BUILT_IN_RESULTS), str(config.file)))
        else:
            found.append(ConfigDefault(name, "", ""))
    return found


def apply_config_defaults(environment: MutableMapping[str, str] = os.environ) -> list[ConfigDefault]:
    """Set environment variables from the file, where they are not set, and return those values.

    Child processes inherit them.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    if find_config_file(Path.cwd()) is None:  # without the pydantic models, which take 0.2 s to import
        return []
    applied = [default for default in config_defaults(environment=environment) if default.source.endswith(FILE_NAME)]
    for default in applied:
        environment[VARIABLE_OF[default.name]] = default.value
    return applied


def _unreadable(file: Path, reason: str | None) -> UsageError:
    return UsageError(f"cannot read {file}: {reason}", code="invalid-config")
