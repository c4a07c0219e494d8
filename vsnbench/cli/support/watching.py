"""`vsnbench run --watch`: repeats the trials whenever the files of a model change."""

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich.markup import escape

from vsnbench.errors import ExitCode, UsageError
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.models.names import is_address
from vsnbench.results.files.directory import TEMPORARY_RESULTS
from vsnbench.runtime.signals import EndAsked
from vsnbench.text.terminal import Console

_POLL_INTERVAL_S = 0.3


def run_and_watch(
    models: Sequence[str],
    robot: str,
    workers: str,
    results: Path | None,
    database: str | None,
    files: Sequence[Path | None],
) -> int:
    """Run the current command without --watch, again after every change, until interrupted; return the exit code.

    Args:
        models: values of `--model`; one `package.module:Class` is allowed.
        robot: value of `--robot`.
        workers: value of `--workers`.
        results: value of `--results`; must be absent.
        database: value of `--db`; must be absent.
        files: further files of the model.

    Raises:
        UsageError: it is not a simulated run of one class on this machine.
    """
    if not robot.startswith("simulated"):
        raise UsageError(f"--watch with --robot {robot}", advice="only a simulated robot may start without an operator")
    is_class = len(models) == 1 and ":" in models[0] and not is_address(models[0])
    if not is_class or workers.startswith("ray://"):
        raise UsageError("--watch runs one class on this machine", advice="give --model package.module:Class")
    if results is not None or database is not None:
        raise UsageError("--watch discards its results", advice="leave out --results and --db, or --watch")
    watched = [*_sources(models[0]), *(file for file in files if file is not None)]
    console = Console(file=sys.stderr, highlight=False, soft_wrap=True)
    command = [sys.executable, "-m", "vsnbench.cli.main", *(word for word in sys.argv[1:] if word != "--watch")]
    end_asked = EndAsked()
    with ScratchDirectory("watch") as scratch, end_asked.listening():
        discarded = scratch.path / "results"
        while not end_asked:
            before = _state(watched)
            shutil.rmtree(discarded, ignore_errors=True)
            code = _run([*command, "--fail-fast", "--results", str(discarded)], end_asked)
            if end_asked:
                break
            result = "[green]passed[/green]" if code == 0 else f"[red]exit code {code}[/red]"
            console.print(f"{result}; waiting for a change of {escape(_listed(watched))}; Ctrl-C to stop")
            while not end_asked.wait(_POLL_INTERVAL_S) and _state(watched) == before:
                pass
    return ExitCode.INTERRUPTED


def _run(command: Sequence[str], end_asked: EndAsked) -> int:
    with subprocess.Popen(command, env=os.environ | {TEMPORARY_RESULTS: "1"}) as child:
        while child.poll() is None:
            if end_asked.wait(_POLL_INTERVAL_S):
                child.terminate()  # it halts its robot and keeps its record; the terminal has sent it Ctrl-C as well
                return child.wait()
        return child.returncode


def _sources(model: str) -> Iterator[Path]:
    """Yield the directories to watch for a class: its package, or the directory of its file."""
    top = model.partition(":")[0].partition(".")[0]
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    spec = importlib.util.find_spec(top)
    if spec is None:
        raise UsageError(f"--model {model}: module {top} is neither in {here} nor installed")
    if spec.submodule_search_locations:
        yield from map(Path, spec.submodule_search_locations)
    elif spec.origin is not None:
        yield Path(spec.origin).parent


def _state(watched: Iterable[Path]) -> frozenset[tuple[str, int, int]]:
    """Return path, modification time and size of every watched file."""
    found = set()
    for place in watched:
        for file in [place] if not place.is_dir() else place.rglob("*.py"):
            try:
                stat = file.stat()
            except OSError:  # an editor is replacing it
                continue
            found.add((str(file), stat.st_mtime_ns, stat.st_size))
    return frozenset(found)


def _listed(watched: Iterable[Path]) -> str:
    """Return paths, relative to the working directory where they are in it."""
    here = Path.cwd()
    return ", ".join(str(path.relative_to(here) if path.is_relative_to(here) else path) for path in watched)
