"""Prepares the words of a command line for the parser, which has no options with optional values."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import takewhile
from typing import Any

from vsnbench.errors import UsageError

_ADDRESS = re.compile(r"(?:[\w.-]*|\[[0-9A-Fa-f:]+\]):\d{1,5}|\d+(?:\.\d+){3}")
_OPTIONAL_VALUE: Mapping[str, Callable[[str], bool]] = {
    "--console": lambda word: _ADDRESS.fullmatch(word) is not None,
    "--isolate": lambda word: not word.startswith("-"),
}
"""Option with an optional value -> whether the next word is its value."""
_DIRECTORIES = ("--results", "--output", "-o", "--website")


def mark_missing_values(words: Sequence[str]) -> list[str]:
    """Return a command line in which an option without its optional value has an empty one: `--console=`."""
    marked: list[str] = []
    for place, word in enumerate(words):
        if word == "--":
            return [*marked, *words[place:]]
        following = words[place + 1 : place + 2]
        is_value = _OPTIONAL_VALUE.get(word)
        missing = is_value is not None and not (following and is_value(following[0]))
        marked.append(f"{word}=" if missing else word)
    return marked


def refuse_empty_directories(words: Sequence[str]) -> None:
    """Refuse an empty directory, as an unset shell variable gives it: the current directory would be used.

    Args:
        words: the command line without the name of the program.

    Raises:
        UsageError: there is one.
    """
    typed = list(takewhile(lambda word: word != "--", words))
    for place, word in enumerate(typed):
        empty = word.removesuffix("=") if word.endswith("=") else word if typed[place + 1 : place + 2] == [""] else ""
        if empty in _DIRECTORIES:
            raise UsageError(
                f"{empty} is empty", advice="name a directory; an unset shell variable is empty", code="empty-value"
            )


def refuse_repeated(root: Any, words: Sequence[str]) -> None:
    """Refuse an option with one value that is given twice; the parser would take the last value.

    Args:
        root: the command line, as Typer builds it.
        words: the command line without the name of the program.

    Raises:
        UsageError: an option is repeated.
    """
    command: Any = root
    typed = list(takewhile(lambda word: word != "--", words))
    for word in typed:
        command = getattr(command, "commands", {}).get(word, command)
    given = Counter(word.split("=", 1)[0] for word in typed if word.startswith("-"))
    for parameter in command.params:
        once = not (parameter.multiple or getattr(parameter, "is_flag", False) or getattr(parameter, "count", False))
        times = sum(given[name] for name in parameter.opts)
        if once and times > 1:
            advice = "give it once" + ("; each record has its own report" if "--results" in parameter.opts else "")
            raise UsageError(
                f"{parameter.opts[0]} was given {times} times, and takes one value",
                advice=advice,
                code="repeated-option",
            )
