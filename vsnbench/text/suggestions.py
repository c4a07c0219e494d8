"""Suggests the known name that a mistyped one is closest to."""

from collections.abc import Iterable
from difflib import get_close_matches


def closest(name: str, known: Iterable[str]) -> str:
    """Return the known name closest to a name, or an empty string if none is close."""
    return next(iter(get_close_matches(name, sorted(set(known)), n=1)), "")


def unknown_name(kind: str, name: str, known: Iterable[str], where: str) -> str:
    """Return the message for an unknown name, with a suggestion or the known names; `where` is like `this record`."""
    names = sorted(set(known))
    suggestion = closest(name, names)
    advice = f"Did you mean {suggestion!r}?" if suggestion else f"It has {', '.join(names) or 'none'}."
    return f"{kind} {name!r} is not in {where}. {advice}"
