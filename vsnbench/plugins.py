"""Finds what third parties add: entry points of a group, and anything named as `package.module:Class`."""

import importlib
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from vsnbench.errors import VsnbenchError
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
        raise error_class(f"{asked_for}: cannot import {where}: {error_line(error)}") from error
    if not callable(found):
        raise error_class(f"{asked_for}: {where} is neither a class nor a function that makes {makes}")
    return found
