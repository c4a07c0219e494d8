"""What a person's typed answers mean: pure, strict where a slip would become a verdict."""

import math
from enum import Enum

from vsnbench.errors import UsageError
from vsnbench.protocol.persons_word import metres
from vsnbench.protocol.site import Site

_NOTHING = frozenset({"no", "n", "nothing", "none", "nope", "nil", "-", "no collision", "not at all", "0"})
_LATER = frozenset({"later", "l", "skip"})
_YES = frozenset({"yes", "y"})
_GO = frozenset({"", "go"}) | _YES
_END = frozenset({"end", "quit", "q"})
_KEEP = frozenset({"keep", "k"})


class Said(Enum):
    """An answer that is no measurement."""

    NOTHING = "nothing"
    """It touched nothing."""
    LATER = "later"
    """It is not judged now."""
    KEEP = "keep"
    """The estimate is right."""
    GO = "go"
    END = "end"
    """The session is over."""


class MisreadError(ValueError):
    """An answer that cannot be taken; its words say what can."""


def what_was_touched(answer: str) -> Said | str:
    """Return what a person says the robot touched: `NOTHING`, `LATER`, or the thing's name.

    Raises:
        MisreadError: it does not say.
    """
    words = " ".join(answer.split())
    if not words:
        raise MisreadError("type no, or what it touched, or later")
    if words.lower().rstrip(".!") in _NOTHING:
        return Said.NOTHING
    if words.lower() in _LATER:
        return Said.LATER
    if words.lower() in _YES:
        raise MisreadError("what did it touch?")
    return words


def may_begin(answer: str) -> Said:
    """Return whether the robot may drive: `GO`, `LATER` for another trial first, or `END`.

    Raises:
        MisreadError: it does not say.
    """
    word = answer.strip().lower()
    for words, said in ((_GO, Said.GO), (_LATER, Said.LATER), (_END, Said.END)):
        if word in words:
            return said
    raise MisreadError("Enter alone to go, or skip, or end")


def confirmed(answer: str) -> bool:
    """Return whether it is a yes; `no` and `later` are none.

    Raises:
        MisreadError: it is neither.
    """
    word = answer.strip().lower()
    if word in _YES:
        return True
    if word in _LATER or word in _NOTHING:
        return False
    raise MisreadError("type yes or no")


def measured_m(answer: str, site: Site) -> Said | float:
    """Return the metres that a person measured, `KEEP` or `LATER`; `84 cm` is 0.84 m, a bare `84` none.

    Raises:
        MisreadError: it is no distance within the site.
    """
    word = answer.strip().lower()
    if not word:
        raise MisreadError("type metres like 0.84, or keep, or later")
    if word in _KEEP:
        return Said.KEEP
    if word in _LATER:
        return Said.LATER
    try:
        return metres(word, diagonal_m(site))
    except UsageError as error:
        raise MisreadError(str(error)) from error


def diagonal_m(site: Site) -> float:
    """Return the longest distance that there can be within a site, metres."""
    corners = [corner for room in site.rooms for corner in room.polygon]
    if not corners:
        return math.inf
    xs, ys = zip(*corners, strict=True)
    return math.hypot(max(xs) - min(xs), max(ys) - min(ys))
