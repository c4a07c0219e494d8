"""What is said of a command line that does not parse: one line, with what was likely meant in its place.

The parser's own errors become a `UsageError` here, whatever verb they are of, so that they look like every other.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from enum import Enum
from typing import Any

import typer
from typer.core import TyperGroup

from vsnbench.cli import likely_words
from vsnbench.errors import UsageError
from vsnbench.harmless_text import harmless

_PROGRAM = "vsnbench"
_ParserError: type[Any] = typer.BadParameter.__mro__[1]
"""What the parser raises of itself, in whichever package this Typer has it."""


class RefusingGroup(TyperGroup):
    """The whole command line: what the parser refuses anywhere in it is raised as a `UsageError`."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Read the words before the verb."""
        with _refusing():
            return super().make_context(*arguments, **options)

    def invoke(self, ctx: Any) -> Any:
        """Read the verb and its words, and run it."""
        with _refusing():
            return super().invoke(ctx)


@contextmanager
def _refusing() -> Iterator[None]:
    try:
        yield
    except _ParserError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # the help of a group of verbs, which Typer prints
            raise
        raise refusal_of(error) from error


def refusal_of(error: Any) -> UsageError:
    """Return what to say of a parser's error.

    Args:
        error: a usage error of the parser, with the context in which it was raised.
    """
    context, kind = error.ctx, type(error).__name__
    if kind == "BadOptionUsage":
        return UsageError(f"{error.option_name} needs a value, and none follows it")
    if context is None:
        return UsageError(harmless(error.format_message()))
    called = context.command_path
    path = called.removeprefix(_PROGRAM).strip()
    if kind == "NoSuchOption":
        return _no_option(error.option_name, path, called, context.command)
    if kind == "MissingParameter" and error.param is not None:
        name = error.param.name.replace("_", " ")
        needed = error.param.opts[0] if error.param.param_type_name == "option" else _with_article(name)
        advice = likely_words.VALUES.get((path, error.param.name)) or _example(called, context.command)
        return UsageError(f"`{called}` needs {needed}", advice=advice)
    if kind == "BadParameter" and error.param is not None:
        return _bad_value(error, path)
    said = error.message
    if said.startswith("No such command "):
        word = said.removeprefix("No such command ").partition("'. Did")[0].strip("'.")
        return _no_command(word, path, called, context.command)
    if said.startswith("Got unexpected extra argument"):
        return _one_too_many(said.partition("(")[2].partition(" (")[2].rstrip(")") or said, called, context.command)
    return UsageError(f"`{called}`: {harmless(said)}", advice=f"`{called} -h` has its options")


def _no_option(option: str, path: str, called: str, command: Any) -> UsageError:
    options = {name: one for one in command.params for name in one.opts if name.startswith("--")}
    forms = next((_choices(one) for one in command.params if "--format" in one.opts), [])
    near = get_close_matches(option, options, n=1, cutoff=0.65)
    if (path, option) in likely_words.OPTIONS:
        advice = likely_words.OPTIONS[path, option]
    elif option.lstrip("-") in forms:
        advice = f"`--format {option.lstrip('-')}`"
    elif near:
        advice = f"did you mean {near[0]}?"
    else:
        advice = f"`{called} -h` has its options"
    return UsageError(f"`{called}` has no option {harmless(option)}", advice=advice)


def _no_command(word: str, path: str, called: str, group: Any) -> UsageError:
    names = list(group.commands)
    same = [name for name in likely_words.SAME.get(word, ()) if name in names]
    near = get_close_matches(word, names, n=1, cutoff=0.65)
    if not path and word in likely_words.VERBS:
        advice = likely_words.VERBS[word]
    elif (path, word) in likely_words.SUBCOMMANDS:
        advice = likely_words.SUBCOMMANDS[path, word]
    elif word.isdecimal() and path in ("", "episodes"):
        advice = f"`vsnbench episodes show {word}`"
    elif same or near:
        advice = " or ".join(f"`{called} {name}`" for name in same or near)
    else:
        advice = f"there are {', '.join(names)}" if path else "`vsnbench -h` has its verbs"
    return UsageError(f"there is no `{called} {harmless(word)}`", advice=advice)


def _one_too_many(words: str, called: str, command: Any) -> UsageError:
    word = words.split(maxsplit=1)[0]
    options = {name for one in command.params for name in one.opts}
    advice = f"`{called} -h` has what it takes"
    if word.isdecimal() and "--campaign" in options:
        advice = f"`vsnbench episodes show {word}` has an episode, `{called} --campaign {word}` a campaign"
    elif "--goal" in options and _is_goal(word):
        advice = f"`{called} --goal {word}`"
    elif option := next((name for name in ("--robot", "--model", "--site") if name in options), ""):
        advice = f"`{called} {option} {harmless(word)}`?"
    return UsageError(f"`{called}` takes no {harmless(words)}", advice=advice)


def _with_article(name: str) -> str:
    if name.endswith("s"):
        return name
    return f"an {name}" if name[0] in "aeiou" else f"a {name}"


def _is_goal(word: str) -> bool:
    from vsnbench.protocol.categories import GOAL_CATEGORIES

    return word in GOAL_CATEGORIES


def _bad_value(error: Any, path: str) -> UsageError:
    parameter = error.param
    name = next((each for each in parameter.opts if each.startswith("--")), parameter.name.replace("_", " "))
    statement, mend = harmless(error.message.rstrip(".")).removeprefix("Value error, "), ""
    found = getattr(error.__cause__, "errors", None)
    if callable(found):
        from vsnbench.protocol.number_faults import number_words

        detail = found()[0]
        given = _as_number(detail["input"])
        statement, mend = number_words(detail | {"loc": (parameter.name,), "input": given}) or (statement, "")
    advice = likely_words.VALUES.get((path, parameter.name), mend)
    return UsageError(f"{name}: {statement}", advice=advice)


def _as_number(typed: object) -> object:
    try:
        return float(typed) if isinstance(typed, str) else typed
    except ValueError:
        return typed


def _choices(parameter: Any) -> list[str]:
    return [str(each) for each in type(parameter.default)] if isinstance(parameter.default, Enum) else []


def _example(called: str, command: Any) -> str:
    """Return the first example of a verb's help."""
    lines = (line.strip() for line in (command.help or "").splitlines())
    found = next((line for line in lines if line.startswith(f"{called} ")), "")
    return f"`{found.partition('  ')[0]}`, for instance" if found else f"`{called} -h` says what that is"
