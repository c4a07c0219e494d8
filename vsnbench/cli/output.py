"""What a verb puts on stdout: its result, as JSON for scripts where they ask; and what --quiet keeps from stderr."""

import functools
import inspect
import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]

WITHOUT_RESULT = frozenset(
    {
        ("ros1", "discrete-move"),
        ("ros1", "simulate"),
        ("ros2", "discrete-move"),
        ("ros2", "simulate"),
        ("ros2", "undock"),
        ("sites", "edit"),
        ("models", "serve"),
    }
)
"""Verbs that serve, or move a robot, until they are ended: what they print is no result."""


Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="The result alone: no progress, no notes; errors are said.")]


def hushable(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a verb that knows --quiet: it prints its result then, and nothing else but what stopped it."""
    if hasattr(function, "hushable"):
        return function
    signature = inspect.signature(function, eval_str=True)

    @functools.wraps(function)
    def verb(*arguments: Any, quiet: bool, **options: Any) -> Any:
        with hushed() if quiet else nullcontext():
            return function(*arguments, **options)

    option = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
    verb.__signature__ = signature.replace(parameters=[*signature.parameters.values(), option])  # type: ignore[attr-defined]
    verb.__annotations__ = {name: each.annotation for name, each in signature.parameters.items()} | {"quiet": Quiet}
    verb.hushable = True  # type: ignore[attr-defined]
    return verb


@contextmanager
def goes_on_after_ctrl_c() -> Iterator[None]:
    """Say what Ctrl-C ends where no trial is under way that would say it: before the first, and between campaigns."""
    try:
        yield
    except KeyboardInterrupt:
        words = "stopped (Ctrl-C), with no trial under way: the same command goes on with what is left"
        sys.stderr.write(f"\nvsnbench: {words}\n")
        raise


_TERMINAL = 80
"""Columns. A longer line of a docstring was filled in the source, and goes on in the next; a shorter one is meant."""


def flowing(docstring: object) -> str:
    """Return a docstring as a help text whose prose fills the terminal; what is indented, or typed, keeps its lines."""
    lines: list[str] = []
    filled = False
    for line in inspect.cleandoc(docstring if isinstance(docstring, str) else "").split("\n"):
        prose = bool(line) and not line.startswith((" ", "vsnbench "))
        if filled and prose:
            lines[-1] += f" {line}"
        else:
            lines.append(line)
        filled = prose and len(line) > _TERMINAL
    return "\n".join(lines)


_hush = 0


def is_hushed() -> bool:
    """Whether nothing but results and errors is to be heard."""
    return _hush > 0


@contextmanager
def hushed() -> Iterator[None]:
    """Say nothing on stderr while this is entered; what is raised is said by whoever catches it outside."""
    global _hush
    heard, level = sys.stderr, logging.getLogger().level
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        sys.stderr = nowhere
        logging.getLogger().setLevel(logging.CRITICAL)
        _hush += 1
        try:
            yield
        finally:
            _hush -= 1
            sys.stderr = heard
            logging.getLogger().setLevel(level)


def print_json(value: object) -> None:
    """Print a result for scripts."""
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False, default=str))


def print_files(files: Iterable[Path | str], *, as_json: bool, **more: object) -> None:
    """Print which files were written, one a line; as JSON a list under `files`, with whatever else is known."""
    written = [str(file) for file in files]
    if as_json:
        print_json({"files": written, **more})
        return
    for file in written:
        typer.echo(file)
