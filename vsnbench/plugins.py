"""Imports third-party classes by entry point or as `package.module:Class`, and hashes their source."""

import ast
import hashlib
import importlib
import re
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import distributions, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.text.sanitize import error_line
from vsnbench.text.suggestions import closest

_LONGEST_SOURCE_BYTES = 2**20
LISTED = 5
"""Most classes that a message lists."""


def plug_ins(group: str) -> dict[str, str]:
    """Return the installed plug-ins of an entry point group: name -> `package.module:Class`."""
    return {point.name: point.value for point in entry_points(group=group)}


def import_factory(where: str, kind: str, name: str, error_class: type[VsnbenchError]) -> Any:
    """Import the class or function named `package.module:Class`.

    The working directory is searched last, and only if the user wrote `package.module:Class`: it can be an archive of
    unknown origin.

    Args:
        where: class or function to import.
        kind: `model` or `robot`, for messages.
        name: name that the user wrote: `where` itself, or that of a plug-in.
        error_class: class of the error to raise.

    Raises:
        VsnbenchError: of `error_class`: the import failed, or the object is not callable.
    """
    module_name, _, attribute = where.partition(":")
    if name == where and (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    try:
        found: Any = importlib.import_module(module_name)
        for part in attribute.split("."):
            found = getattr(found, part)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # importing a plug-in runs its code, which can raise anything
        module = error.obj if isinstance(error, AttributeError) else None
        if isinstance(module, ModuleType) and module is sys.modules.get(module_name):
            raise error_class(
                f"{kind} {name}: {module_name} has no {attribute}",
                advice=_classes_advice(module, attribute),
                code="import-failed",
            ) from error
        advice = _import_advice(module_name, error) if name == where else ""
        raise error_class(
            f"{kind} {name}: cannot import {where}: {error_line(error)}", advice=advice, code="import-failed"
        ) from error
    if not callable(found):
        raise error_class(f"{kind} {name}: {where} is neither a class nor a function", code="not-callable")
    return found


def _classes_advice(module: ModuleType, missing: str) -> str:
    """Return advice about a class that a module does not have: the closest one, all of its own, or an empty string."""
    if near := closest(missing, (name for name, found in vars(module).items() if isinstance(found, type))):
        return f"did you mean {module.__name__}:{near}?"
    own = [f"{module.__name__}:{name}" for name in own_classes(module) if not name.startswith("_")]
    return f"it has {' or '.join(own[:LISTED])}" if own else ""


def own_classes(module: ModuleType) -> dict[str, type]:
    """Return the classes that a module defines, by name; a package can import them from its own modules."""
    inside = f"{module.__name__}."
    return {
        name: found
        for name, found in vars(module).items()
        if isinstance(found, type) and f"{found.__module__}.".startswith(inside)
    }


def _import_advice(module_name: str, error: BaseException) -> str:
    """Return advice about a user's module that was not found, or an empty string if something else is missing."""
    if "/" in module_name or module_name.endswith(".py"):
        if classes := _classes_of_file(Path(module_name)):
            return f"name the module, not its file: {' or '.join(classes)}"
        return "name the module, not its file: walker.policy for walker/policy.py, in the directory of walker"
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    if missing is None or not f"{module_name}.".startswith(f"{missing}."):
        return ""
    file = module_name.replace(".", "/") + ".py"
    return f"it is neither installed nor in {Path.cwd()}: go to the directory that has {file} in it"


def _classes_of_file(file: Path) -> list[str]:
    """Return the classes of a Python file below the working directory as `package.module:Class`; nothing is run."""
    if file.suffix != ".py" or file.is_absolute() or ".." in file.parts or not file.is_file():
        return []
    try:
        with file.open("rb") as opened:
            tree = ast.parse(opened.read(_LONGEST_SOURCE_BYTES))
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    module = ".".join(file.with_suffix("").parts)
    return [f"{module}:{node.name}" for node in tree.body if isinstance(node, ast.ClassDef) and node.bases][:3]


def source_sha256(kind: type) -> str:
    """Return the hash of the source of a third-party class.

    The source is every loaded module of the class's package, or for a single module those in its directory.
    """
    digest = hashlib.sha256()
    for name, file in sorted(_modules_with(kind.__module__)):
        try:
            digest.update(f"{name}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
        except OSError:  # deleted since it was imported
            digest.update(f"{name}\0gone\n".encode())
    return digest.hexdigest()


def _modules_with(name: str) -> Iterator[tuple[str, Path]]:
    """Yield the loaded modules of a package, or those in the directory of a single module."""
    top = name.partition(".")[0]
    own = file_of_module(sys.modules.get(name))
    if own is None:
        return
    installed = any(part in ("site-packages", "dist-packages") for part in own.parts)
    alone = not installed and not hasattr(sys.modules.get(top), "__path__")
    for other, module in list(sys.modules.items()):  # some thousands: what their names decide is asked first
        mine = other.partition(".")[0] == top
        near = mine or (alone and str(getattr(module, "__file__", "")).startswith(str(own.parent)))
        file = file_of_module(module) if near and other != "__main__" else None
        if file is not None and (mine or file.parent == own.parent):
            yield other, file


def package_version(package: str) -> str:
    """Return the version of the installed distribution that has this top-level package, or an empty string.

    `importlib.metadata.packages_distributions` splits every path of every distribution, which takes 0.2 s.
    """
    listed = re.compile(rf"^{re.escape(package)}(/[^,\n]*)?\.py,", re.MULTILINE)
    for distribution in distributions():
        declared = distribution.read_text("top_level.txt")
        if package in declared.split() if declared else listed.search(distribution.read_text("RECORD") or ""):
            return distribution.version
    return ""


def file_of_module(module: object) -> Path | None:
    """Return the file of a loaded module, or None."""
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and Path(file).is_file() else None


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UsageError:
    """Return the error for a name that does not exist, with the nearest name and all names."""
    names = list(known)
    for file in dict.fromkeys((Path(name), Path(f"{name.replace('.', '/')}.py"))):
        if classes := _classes_of_file(file):
            what = f"{kind} {name} is a file" if str(file) == name else f"no {kind} {name!r}, but a file {file}"
            return UsageError(what, advice=f"name the class in it: {' or '.join(classes)}", code=f"unknown-{kind}")
    near = closest(name, names)
    suggestion = f"did you mean {near}? " if near else ""
    return UsageError(
        f"no {kind} {name!r}",
        advice=f"{suggestion}Known: {', '.join(names)}, or your own as package.module:Class",
        code=f"unknown-{kind}",
    )
