"""Finds what third parties add, by entry point or as `package.module:Class`, and hashes the code it was made from."""

import hashlib
import importlib
import sys
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.harmless_text import error_line


def plug_ins(group: str) -> dict[str, str]:
    """Return the installed plug-ins of an entry point group: name -> `package.module:Class`."""
    return {point.name: point.value for point in entry_points(group=group)}


def import_factory(where: str, kind: str, name: str, makes: str, error_class: type[VsnbenchError]) -> Any:
    """Import the class or function named `package.module:Class`.

    Where the user named it so, and no plug-in, the working directory is looked into last; at no other time, because
    it may be somebody else's archive.

    Args:
        where: what to import.
        kind: what the user asked for, for the message: `model`.
        name: how the user named it: `where` itself, or a plug-in's name.
        makes: what it should make, for the message: `a policy`.
        error_class: what to raise.

    Raises:
        VsnbenchError: of `error_class`: it cannot be imported, or cannot be called.
    """
    module_name, _, attribute = where.partition(":")
    asked_for = f"{kind} {name}"
    if name == where and (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    try:
        found: Any = importlib.import_module(module_name)
        for part in attribute.split("."):
            found = getattr(found, part)
    except (Exception, SystemExit) as error:  # importing a plug-in runs its code: anything can happen
        advice = _where_it_was_looked_for(module_name, error) if name == where else ""
        raise error_class(f"{asked_for}: cannot import {where}: {error_line(error)}", advice=advice) from error
    if not callable(found):
        raise error_class(f"{asked_for}: {where} is neither a class nor a function that makes {makes}")
    return found


def _where_it_was_looked_for(module_name: str, error: BaseException) -> str:
    """Return what to do about a module of the user's own that is not found; empty where something else is missing."""
    if "/" in module_name or module_name.endswith(".py"):
        return "name the module, not its file: walker/policy.py is walker.policy where walker lies"
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    if missing is None or not f"{module_name}.".startswith(f"{missing}."):
        return ""
    file = module_name.replace(".", "/") + ".py"
    return f"it is neither installed nor in {Path.cwd()}: go to the directory that has {file} in it"


def source_sha256(made: type) -> str:
    """Return the hash of what a third party's class was made from.

    That is every module of its own package, or beside its own file, that is loaded by now.
    """
    digest = hashlib.sha256()
    for name, file in sorted(_modules_with(made.__module__)):
        try:
            digest.update(f"{name}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
        except OSError:  # gone since it was imported: what runs is not what lies there
            digest.update(f"{name}\0gone\n".encode())
    return digest.hexdigest()


def _modules_with(name: str) -> Iterator[tuple[str, Path]]:
    """Yield the loaded modules of one package, or those beside a module that stands alone."""
    top = name.partition(".")[0]
    own = file_of_module(sys.modules.get(name))
    if own is None:
        return
    alone = not hasattr(sys.modules.get(top), "__path__")
    installed = any(part in ("site-packages", "dist-packages") for part in own.parts)
    for other, module in list(sys.modules.items()):
        if other == "__main__":
            continue
        file = file_of_module(module)
        if file is None:
            continue
        beside = alone and not installed and file.parent == own.parent
        if other == name or other.partition(".")[0] == top or beside:
            yield other, file


def file_of_module(module: object) -> Path | None:
    """Return the file that a loaded module was read from; None for what has none."""
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and Path(file).is_file() else None


def none_so_called(what: str, name: str, known: Iterable[str]) -> UsageError:
    """Return what to say of a name that nothing has: the nearest one, then all that there are.

    Args:
        what: is named so: model, robot.
        name: as it was typed.
        known: the names that there are.
    """
    names = list(known)
    near = get_close_matches(name, names, n=1, cutoff=0.6)
    likely = f"did you mean {near[0]}? The" if near else "the"
    return UsageError(
        f"no {what} {name!r}: {likely} known ones are {', '.join(names)}; your own is named as package.module:Class"
    )
