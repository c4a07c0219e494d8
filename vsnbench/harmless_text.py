"""Makes text of unknown origin harmless: names can come from anywhere, and a reader must see them as text."""

import unicodedata

LONGEST_LINE = 500
"""Characters of an error's line; what somebody else's code says can be megabytes long."""
_SPACES = {"\t", "\n", "\r"}


def harmless(text: str) -> str:
    """Return one line of printable text: control, format and other invisible characters become visible escapes.

    A terminal obeys control characters, and the bidirectional ones make a name read as another in a browser.
    """
    return text if text.isprintable() else "".join(mark if mark.isprintable() else _visible(mark) for mark in text)


def error_line(error: BaseException, *, named: bool = True) -> str:
    """Return what somebody else's code raised as one bounded line: `ValueError: no such layer`.

    Whatever the exception is: its `__str__` may raise or answer with megabytes, escapes or lone surrogates.

    Args:
        error: what was raised.
        named: with the name of its class in front; without, only where it says nothing else.
    """
    try:
        words = str(error)[: 4 * LONGEST_LINE]
    except BaseException as second:  # also an exit raised there, which is not this process's own
        words = f"(its message cannot be read: {type(second).__name__})"
    words = " ".join(words.split())
    name = type(error).__name__
    line = harmless((f"{name}: {words}" if named else words) if words else name)
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 1]}…"


def counted(number: int, one: str, several: str = "") -> str:
    """Return a number with its noun: `1 episode`, `2 episodes`; `several` where another letter than an s is added."""
    return f"{number} {one if number == 1 else several or one + 's'}"


def _visible(mark: str) -> str:
    if mark in _SPACES or unicodedata.category(mark) == "Zs":
        return " "
    return ascii(mark)[1:-1]
