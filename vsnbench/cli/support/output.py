"""Output of commands: results on stdout, as text or JSON, and the options --quiet, --verbose and --log-file."""

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.errors import UsageError
from vsnbench.text.log_output import log_more, without_log_on_stderr
from vsnbench.text.sanitize import counted, sanitize
from vsnbench.text.streams import stdout_as_stderr

if TYPE_CHECKING:
    from vsnbench.settings.validation import SettingsFault

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only the result. Errors still go to stderr.")]
Verbose = Annotated[
    int,
    typer.Option(
        "--verbose", "-v", count=True, show_default=False, help="Log more to stderr; -vv for debugging.", metavar=""
    ),
]
LogFile = Annotated[
    Path | None,
    typer.Option(
        "--log-file",
        metavar="FILE",
        help="File to append log messages to, with times and levels; also those of workers on this machine.",
    ),
]

WITHOUT_RESULT = frozenset(
    {
        ("robots", "simulate"),
        ("robots", "serve"),
        ("robots", "undock"),
        ("sites", "edit"),
        ("models", "serve"),
        ("browse",),
    }
)
"""Commands that serve or move a robot until they are stopped; they print no result and have no --quiet."""

_TERMINAL_WIDTH = 80
_quiet_depth = 0


def with_output_options(function: Callable[..., Any], *, has_result: bool = True) -> Callable[..., Any]:
    """Return a command with the options --verbose and --log-file, and with --quiet if it prints a result."""
    if hasattr(function, "has_output_options"):
        return function
    signature = inspect.signature(function, eval_str=True)

    @functools.wraps(function)
    def command(*arguments: Any, verbosity: int, log_file: Path | None, quiet: bool = False, **options: Any) -> Any:
        if quiet and verbosity:
            raise UsageError("--quiet and --verbose contradict each other", advice="give one of them")
        log_more(verbosity, log_file)
        with silence() if quiet else nullcontext():
            return function(*arguments, **options)

    quiet_option = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
    added = [
        *([quiet_option] if has_result else []),
        inspect.Parameter("verbosity", inspect.Parameter.KEYWORD_ONLY, default=0, annotation=Verbose),
        inspect.Parameter("log_file", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=LogFile),
    ]
    command.__signature__ = signature.replace(parameters=[*signature.parameters.values(), *added])  # type: ignore[attr-defined]
    command.__annotations__ = {
        parameter.name: parameter.annotation for parameter in (*signature.parameters.values(), *added)
    }
    command.has_output_options = True  # type: ignore[attr-defined]
    return command


@contextmanager
def resumable() -> Iterator[None]:
    """Tell the user on Ctrl-C between trials that the command can be resumed; during a trial the runner does."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write("\nvsnbench: stopped (Ctrl-C) between trials: the same command resumes\n")
        raise


def join_long_lines(docstring: object) -> str:
    """Return a docstring as help text: a line over 80 columns was wrapped in the source and continues in the next.

    Short lines, indented lines and command lines keep their line breaks.
    """
    lines: list[str] = []
    was_wrapped = False
    for line in inspect.cleandoc(docstring if isinstance(docstring, str) else "").split("\n"):
        is_prose = bool(line) and not line.startswith((" ", "vsnbench "))
        if was_wrapped and is_prose:
            lines[-1] += f" {line}"
        else:
            lines.append(line)
        was_wrapped = is_prose and len(line) > _TERMINAL_WIDTH
    return "\n".join(lines)


def is_quiet() -> bool:
    """Return whether only results and errors are printed."""
    return _quiet_depth > 0


@contextmanager
def silence() -> Iterator[None]:
    """Print nothing to stderr while this is entered; exceptions pass."""
    global _quiet_depth
    stderr = sys.stderr
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere, without_log_on_stderr():
        sys.stderr = nowhere
        _quiet_depth += 1
        try:
            yield
        finally:
            _quiet_depth -= 1
            sys.stderr = stderr


def without_prints_of_models(*, as_json: bool) -> AbstractContextManager[None]:
    """Return a context in which models may run: with --json and --quiet, stdout has only the result."""
    return stdout_as_stderr() if as_json or is_quiet() else nullcontext()


def print_json(value: object) -> None:
    """Print a result as JSON."""
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False, default=_json_text))


def _json_text(value: object) -> str:
    """Return a value that JSON lacks as text: times in ISO 8601."""
    return value.isoformat() if isinstance(value, date) else str(value)


def print_result(fields: object, text: str, *, as_json: bool) -> None:
    """Print a result: its fields as JSON, or the text."""
    if as_json:
        print_json(fields)
    else:
        typer.echo(text)


def fault_fields(faults: "Iterable[SettingsFault]") -> list[dict[str, object]]:
    """Return the faults of a checked file as JSON objects."""
    return [
        {"line": fault.line, "field": ".".join(map(str, fault.path)), "problem": fault.problem, "code": fault.code}
        for fault in faults
    ]


def fault_lines(file: str, faults: "Sequence[SettingsFault]") -> list[str]:
    """Return the faults of a checked file as lines of text, and their number as the last line."""
    return [*(f"error: {sanitize(str(fault))}" for fault in faults), f"{file}: {counted(len(faults), 'error')}"]


def print_files(files: Iterable[Path | str], *, as_json: bool, **fields: object) -> None:
    """Print the paths of written files, one per line; as JSON a list `files`, and further fields."""
    written = [str(file) for file in files]
    if as_json:
        print_json({"files": written, **fields})
        return
    for file in written:
        typer.echo(file)


def confirm(statement: str, question: str, nothing_done: str) -> None:
    """Ask a question on the terminal; after a no, exit with code 1.

    Raises:
        UsageError: there is no terminal to ask on.
    """
    if is_quiet() or not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(statement, advice=f"{nothing_done}; add --yes to confirm")
    if not typer.confirm(question, err=True):
        typer.echo(nothing_done, err=True)
        raise typer.Exit(1)
