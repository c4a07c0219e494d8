"""Sanitizes text of unknown origin for terminals and browsers."""

import errno
import re
import unicodedata

from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread

LONGEST_LINE = 500
"""Maximum length of an error line; a message of foreign code can have megabytes."""
TEXT_TIMEOUT_S = 2.0
"""Time limit for `__str__` of an exception."""
_NO_MEMORY = ("allocate memory", "failed to map segment", "Insufficient memory", "bad_alloc")
"""Parts of messages of the loader, PyTorch, OpenCV and C++ for want of main memory."""
_SPACES = {"\t", "\n", "\r"}
_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]|\r(?!\n)")
"""Characters that control a terminal or reverse the order of text; line ends and tabs are kept."""


def sanitize(text: str) -> str:
    """Return one line of printable text: control, format and other invisible characters become visible escapes.

    Bidirectional characters are included: they make one name look like another in a browser.
    """
    return text if text.isprintable() else "".join(char if char.isprintable() else _visible(char) for char in text)


def without_controls(text: str) -> str:
    """Return text of any number of lines with visible escapes for control characters.

    The escapes are those of JSON, so that JSON text keeps its meaning.
    """
    return _CONTROLS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def error_line(error: BaseException, *, named: bool = True) -> str:
    """Return an exception of foreign code as one line of limited length: `ValueError: no such layer`.

    Its `__str__` may raise, never return, or return megabytes, escapes or lone surrogates. Want of memory is stated
    with what to do about it.

    Args:
        error: the exception.
        named: whether the name of its class comes first; otherwise it is used only without a message.
    """
    try:
        message = call_in_thread(lambda: str.__getitem__(str(error), slice(4 * LONGEST_LINE)), TEXT_TIMEOUT_S)
    except TimeLimitError:
        message = "(its message takes too long)"
    except BaseException as second:  # including SystemExit, which must not end this process
        message = f"(its message cannot be read: {type(second).__name__})"
    message = " ".join(message.split())
    name = type(error).__name__
    line = sanitize((f"{name}: {message}" if named else message) if message else name)
    line = line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 1]}…"
    return f"{problem} ({line})" if (problem := memory_problem(error)) else line


def memory_problem(error: BaseException) -> str:
    """Return what to do about an exception for want of main memory, else an empty string."""
    full = isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    texts = [text for text in error.args if isinstance(text, str)]
    if not full and not any(part in text for text in texts for part in _NO_MEMORY):
        return ""
    return (
        "there is not enough memory; close other programs, or raise the limit (`ulimit -v`, the job's or container's)"
    )


def counted(number: int, singular: str, plural: str = "") -> str:
    """Return a number with its noun: `1 episode`, `2 episodes`; the plural adds an s by default."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def duration_text(seconds: float) -> str:
    """Return a duration in a suitable unit: `40 s`, `12 min`, `3.5 h`."""
    hours, minutes = seconds / 3600, seconds / 60
    return f"{hours:.1f} h" if hours >= 1 else f"{minutes:.0f} min" if minutes >= 1 else f"{seconds:.0f} s"


def _visible(character: str) -> str:
    if character in _SPACES or unicodedata.category(character) == "Zs":
        return " "
    return ascii(character)[1:-1]
