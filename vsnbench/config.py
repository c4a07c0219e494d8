"""User configuration, `vsnbench.toml`: values for what a command line and the environment leave out.

The file is searched upward from the working directory, where other users may have put one. A file that others could
have written is refused, and an interpreter is taken from the working directory's own file only.
"""

import math
import os
import shlex
import tomllib
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from vsnbench.errors import UsageError
from vsnbench.files.home import expanded
from vsnbench.files.ownership import writers_other_than_us

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
_PATHS = {"site", "protocol", "results", "weights", "console.certificate", "console.key", "isolation.python"}
_FLAGS = {"isolation.hide_results"}
_NUMBERS: Mapping[str, tuple[type, float, float]] = {
    "console.port": (int, 0, 65535),
    "isolation.memory_gib": (float, 0.1, math.inf),
    "cluster.workers": (int, 1, 4096),
    "cluster.gpus_per_worker": (float, 0, 64),
    "models.act_timeout_s": (float, 0.1, 600),
    "study.model_memory_gib": (float, 0.1, math.inf),
}
"""Key of a section -> type, minimum and maximum."""


@dataclass(frozen=True, slots=True)
class ConsoleConfig:
    """Section `[console]`: the operator's page."""

    address: str = "127.0.0.1"
    port: int = 8710
    """0 for any free port."""
    certificate: Path | None = None
    """PEM file; the page is served over TLS."""
    key: Path | None = None
    """PEM file of the certificate's private key."""


@dataclass(frozen=True, slots=True)
class IsolationConfig:
    """Section `[isolation]`: the process of a model with `--isolate`."""

    python: Path | None = None
    """Interpreter; None for the one that runs vsnbench. Use `isolation_interpreter`."""
    memory_gib: float | None = None
    """Memory limit; None for no limit."""
    hide_results: bool = False
    """Whether the process cannot read the results, which have the robot's true poses; needs Landlock."""


@dataclass(frozen=True, slots=True)
class ClusterConfig:
    """Section `[cluster]`: the workers of `--workers ray://HEAD:PORT`."""

    workers: int | None = None
    """None for as many as the cluster has room for."""
    gpus_per_worker: float = 0.0


@dataclass(frozen=True, slots=True)
class ModelsConfig:
    """Section `[models]`: how models are run."""

    act_timeout_s: float | None = None
    """Time limit for an action; None for 10 s with a remote model and no limit otherwise."""
    device: str | None = None
    """`auto`, `cpu`, `cuda` or `mps`, for models that have a device; not for a third-party model in its own process."""
    fit: str = "full"
    """Images for a model: the robot's (`full`), or cropped to the field of view that it was trained with (`crop`)."""


@dataclass(frozen=True, slots=True)
class StudyConfig:
    """Section `[study]`: how studies are run."""

    model_memory_gib: float | None = None
    """Memory for loaded models; None for half of the machine's."""


@dataclass(frozen=True, slots=True)
class BundleConfig:
    """Section `[bundle]`: what bundles say about their authors."""

    author: str | None = None
    """Names, separated by semicolons."""
    licence: str | None = None
    """SPDX identifier such as CC-BY-4.0, or a URL."""
    citation: str | None = None


@dataclass(frozen=True, slots=True)
class Config:
    """Content of a `vsnbench.toml`; all defaults without one."""

    file: Path | None = None
    defaults: Mapping[str, str] = field(default_factory=dict)
    """Values of the top-level keys in the file."""
    console: ConsoleConfig = ConsoleConfig()
    isolation: IsolationConfig = IsolationConfig()
    cluster: ClusterConfig = ClusterConfig()
    models: ModelsConfig = ModelsConfig()
    study: StudyConfig = StudyConfig()
    bundle: BundleConfig = BundleConfig()


SECTIONS: Mapping[str, type] = {
    "console": ConsoleConfig,
    "isolation": IsolationConfig,
    "cluster": ClusterConfig,
    "models": ModelsConfig,
    "study": StudyConfig,
    "bundle": BundleConfig,
}


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
        raise _invalid(f"cannot read {file}: {error.strerror}") from error
    if not writers:
        return
    advice = "if you trust it, make it and its directory yours alone with chown and chmod go-w"
    if file.parent != directory:
        advice = f"create a {FILE_NAME} of your own, which can be empty, in {directory}; {advice}"
    raise UsageError(f"{writers}, so {_keys_of(file)} not used", advice=advice, code="untrusted-config")


def _keys_of(file: Path) -> str:
    """Return the known keys that a file sets, as the subject of a statement."""
    try:
        with file.open("rb") as opened:
            content = tomllib.loads(opened.read(2**16).decode())
    except (OSError, ValueError, RecursionError):
        content = {}
    keys = [name for name in VARIABLE_OF if name in content]
    for section, kind in SECTIONS.items():
        table = content.get(section)
        if isinstance(table, dict):
            keys += [f"{section}.{key.name}" for key in fields(kind) if key.name in table]
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


def load_config(directory: Path | None = None) -> Config:
    """Return the configuration for a directory (default: the working directory).

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    file = find_config_file(directory or Path.cwd())
    return Config() if file is None else read_config_file(file)


def read_config_file(file: Path) -> Config:
    """Read a `vsnbench.toml`. Relative paths are relative to the file.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise _invalid(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # not UTF-8 or not TOML; the message has line and column
        raise _invalid(f"{file}: {error}") from error
    defaults, sections = {}, {}
    for name, value in content.items():
        if name in SECTIONS:
            sections[name] = _read_section(file, name, value)
        elif name not in VARIABLE_OF:
            raise _unknown_key(file, name, [*VARIABLE_OF, *SECTIONS])
        else:
            defaults[name] = _text(file, name, value)
            if name in _PATHS:
                defaults[name] = _resolve(file, name, defaults[name])
    return Config(file, defaults, **sections)


def config_defaults(directory: Path | None = None, environment: Mapping[str, str] = os.environ) -> list[ConfigDefault]:
    """Return every top-level key with its value and source, for a directory (default: the working directory).

    Environment variables override the file.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    config = load_config(directory)
    found = []
    for name, variable in VARIABLE_OF.items():
        if value := environment.get(variable):
            found.append(ConfigDefault(name, value, variable))
        elif name in config.defaults:
            found.append(ConfigDefault(name, config.defaults[name], str(config.file)))
        elif name == "results" and config.file is not None and config.file.parent != (directory or Path.cwd()):
            # The results directory is next to the file, in whichever subdirectory a command runs.
            found.append(ConfigDefault(name, _resolve(config.file, name, BUILT_IN_RESULTS), str(config.file)))
        else:
            found.append(ConfigDefault(name, "", ""))
    return found


def apply_config_defaults(environment: MutableMapping[str, str] = os.environ) -> list[ConfigDefault]:
    """Set environment variables from the file, where they are not set, and return those values.

    Child processes inherit them.

    Raises:
        UsageError: the file cannot be read, or has an unknown key or an invalid value.
    """
    applied = [default for default in config_defaults(environment=environment) if default.source.endswith(FILE_NAME)]
    for default in applied:
        environment[VARIABLE_OF[default.name]] = default.value
    return applied


def _read_section(file: Path, section: str, table: object) -> Any:
    if not isinstance(table, dict):
        raise _invalid(f"{file}: {section} must be a section: [{section}]")
    known = [f"{section}.{field.name}" for field in fields(SECTIONS[section])]
    values: dict[str, object] = {}
    for key, value in table.items():
        name = f"{section}.{key}"
        if name not in known:
            raise _unknown_key(file, name, known)
        if name in _FLAGS:
            if not isinstance(value, bool):
                raise _invalid(f"{file}: {name} must be true or false, got {value!r}")
            values[key] = value
        elif name in _NUMBERS:
            values[key] = _number(file, name, value)
        else:
            text = _text(file, name, value)
            values[key] = Path(_resolve(file, name, text)) if name in _PATHS else text
    return SECTIONS[section](**values)


def _number(file: Path, name: str, value: Any) -> float:
    kind, minimum, maximum = _NUMBERS[name]
    is_number = isinstance(value, int) if kind is int else isinstance(value, int | float)
    if not is_number or isinstance(value, bool) or not minimum <= value <= maximum:
        limits = f"from {minimum:g}" + ("" if math.isinf(maximum) else f" to {maximum:g}")
        noun = "an integer" if kind is int else "a number"
        raise _invalid(f"{file}: {name} must be {noun} {limits}, got {value!r}")
    number: float = kind(value)
    return number


def _text(file: Path, name: str, value: object) -> str:
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise _invalid(f'{file}: {name} must be text in quotes: {name.rpartition(".")[2]} = "..."')
    return value


def _invalid(statement: str) -> UsageError:
    return UsageError(statement, code="invalid-config")


def _unknown_key(file: Path, name: str, known: list[str]) -> UsageError:
    close = get_close_matches(name, known, n=1)
    advice = f"did you mean {close[0]!r}?" if close else f"known keys: {', '.join(known)}"
    return UsageError(f"{file}: unknown key {name!r}", advice=advice, code="unknown-config-key")


def _resolve(file: Path, name: str, value: str) -> str:
    """Return a path in a file as seen from the working directory.

    The name of an embedded site, of a protocol, and of an interpreter that is found through $PATH, stays as it is.
    """
    is_name = (name in ("site", "protocol") and not value.endswith((".yaml", ".yml"))) or (
        name == "isolation.python" and "/" not in value
    )
    if is_name or (file.parent == Path.cwd() and not value.startswith("~")):
        return value
    return str(file.parent / expanded(value))
