"""Errors of the command line parser as one-line usage errors."""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from vsnbench.errors import UsageError
from vsnbench.text.sanitize import sanitize

_STANDARD_OUTPUT = "-"
_PLAIN = {
    "Input should be a valid integer, unable to parse string as an integer": "not an integer",
    "Input should be a valid number, unable to parse string as a number": "not a number",
    "Input should be greater than or equal to": "must be at least",
    "Input should be less than or equal to": "must be at most",
    "Value error, ": "",
}
"""Phrase of pydantic -> phrase for the user."""


class RootGroup(TyperGroup):
    """The root command. Raises every error of the parser as a `UsageError`."""

    def __init__(self, **settings: Any) -> None:
        """Build the command line, with a check of every option that takes a text or a path."""
        super().__init__(**settings)
        _refuse_dashes(self)

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Parse the options before the command."""
        try:
            return super().make_context(*arguments, **options)
        except typer.TyperException as error:
            _raise_usage_error(error, "vsnbench")

    def invoke(self, ctx: Any) -> Any:
        """Parse the arguments of the command and run it."""
        try:
            return super().invoke(ctx)
        except typer.TyperException as error:
            _raise_usage_error(error, f"{ctx.command_path} {ctx.invoked_subcommand or ''}".strip())


def _raise_usage_error(error: typer.TyperException, command: str) -> NoReturn:
    """Raise an error of the parser as a usage error in one line with the help of the command that did not parse.

    Args:
        error: of the parser; a few kinds do not know their command.
        command: the command, without its subcommand.
    """
    message = " ".join(error.format_message().split())
    if not message:  # Typer has printed the help of a command group that was called without arguments.
        raise error
    for text, plain in _PLAIN.items():
        message = message.replace(text, plain)
    context: Any = getattr(error, "ctx", None)
    where = context.command_path if context is not None else command
    raise UsageError(sanitize(message).rstrip("."), advice=f"see `{where} -h`") from error


def _refuse_dashes(command: Any) -> None:
    """Make every option of a command and its subcommands refuse a value that begins with a dash.

    The parser takes the next argument as the value of an option: `--void --quiet` would void an episode for the reason
    "--quiet".
    """
    for parameter in command.params:
        if parameter.param_type_name == "option" and not parameter.is_flag:
            parameter.callback = partial(_without_dash, parameter.callback)
    for subcommand in getattr(command, "commands", {}).values():
        _refuse_dashes(subcommand)


def _without_dash(then: Callable[..., Any] | None, context: Any, parameter: Any, value: Any) -> Any:
    for item in value if isinstance(value, list | tuple) else [value]:
        text = str(item).strip() if isinstance(item, str | Path) else ""
        typed = [word.rpartition("=")[2] for word in sys.argv[1:]] if text.startswith("-") else []
        if isinstance(item, Path) and any(word.startswith("./") and Path(word) == item for word in typed):
            continue  # the path has lost its ./
        if text.startswith("-") and not (text == _STANDARD_OUTPUT and "--output" in parameter.opts):
            option = next((name for name in parameter.opts if name.startswith("--")), parameter.opts[0])
            raise UsageError(
                f"{option} needs a value, and {sanitize(text)!r} begins with a dash, as options do",
                advice=f"give the value after {option}, without a leading dash; ./-name is a path",
            )
    return then(context, parameter, value) if then is not None else value
