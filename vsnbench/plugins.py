"""Finds what third parties add: entry points of a group, and anything named as `package.module:Class`."""

import importlib
from importlib.metadata import entry_points
from typing import Any

from vsnbench.errors import VsnbenchError


def plug_ins(group: str) -> dict[str, str]:
    """Return the installed plug-ins of an entry point group: name -> `package.module:Class`."""
    return {point.name: point.value for point in entry_points(group=group)}


def import_factory(where: str, asked_for: str, makes: str, error_class: type[VsnbenchError]) -> Any:
    """Import the class or function named `package.module:Class`.

    Args:
        where: what to import.
        asked_for: how the user named it, for the message: `model mylab.policy:Policy`.
        makes: what it should make, for the message: `a policy`.
        error_class: what to raise.

    Raises:
        VsnbenchError: of `error_class`: it cannot be imported, or cannot be called.
    """
    module_name, _, attribute = where.partition(":")
    try:
        found: Any = importlib.import_module(module_name)
        for part in attribute.split("."):
            found = getattr(found, part)
    except Exception as error:  # importing a plug-in runs its code: anything can happen, and it is not our bug
        raise error_class(f"{asked_for}: cannot import {where}: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise error_class(f"{asked_for}: {where} is neither a class nor a function that makes {makes}")
    return found
