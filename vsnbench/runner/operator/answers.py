"""Parses an operator's typed answers; strict where a typing error would become a verdict. Pure."""

from enum import Enum

from vsnbench.errors import UsageError
from vsnbench.runner.operator.prompts import Choice

_NOTHING = frozenset({"no", "n", "nothing", "none", "nope", "nil", "-", "no collision", "not at all", "0"})
_LATER = frozenset({"later", "l", "skip"})
_YES = frozenset({"yes", "y"})
_GO = frozenset({"", "go"}) | _YES
_END = frozenset({"end", "quit", "q"})
_KEEP = frozenset({"keep", "k"})


class TypedAnswer(Enum):
    """An answer from a fixed set."""

    NOTHING = "nothing"
    """The robot touched nothing."""
    LATER = "later"
    """The operator does not judge now."""
    KEEP = "keep"
    """The estimate is right."""


class MisreadError(UsageError):
    """An answer that cannot be used; the message gives valid ones."""

    code = "unclear-answer"


def parse_touched(answer: str) -> TypedAnswer | str:
    """Return `NOTHING`, `LATER`, or the name of what the robot touched.

    Raises:
        MisreadError: the answer is empty or only `yes`.
    """
    text = " ".join(answer.split())
    if not text:
        raise MisreadError("type no, or what it touched, or later")
    if text.lower().rstrip(".!") in _NOTHING:
        return TypedAnswer.NOTHING
    if text.lower() in _LATER:
        return TypedAnswer.LATER
    if text.lower() in _YES:
        raise MisreadError("what did it touch?")
    return text


def parse_go(answer: str) -> Choice:
    """Return `GO`, `SKIP` to run another trial first, or `END`.

    Raises:
        MisreadError: the answer is none of these.
    """
    text = answer.strip().lower()
    for texts, parsed in ((_GO, Choice.GO), (_LATER, Choice.SKIP), (_END, Choice.END)):
        if text in texts:
            return parsed
    raise MisreadError("Enter alone to go, or skip, or end")


def parse_distance(answer: str) -> TypedAnswer | str:
    """Return `KEEP`, `LATER`, or the answer itself as an unchecked distance.

    Raises:
        MisreadError: the answer is empty.
    """
    text = answer.strip().lower()
    if not text:
        raise MisreadError("type metres like 0.84, or keep, or later")
    if text in _KEEP:
        return TypedAnswer.KEEP
    return TypedAnswer.LATER if text in _LATER else text


def parse_confirmation(answer: str) -> bool:
    """Return whether the answer is a yes; `no` and `later` are not.

    Raises:
        MisreadError: the answer is none of these.
    """
    text = answer.strip().lower()
    if text in _YES:
        return True
    if text in _LATER or text in _NOTHING:
        return False
    raise MisreadError("type yes or no")
