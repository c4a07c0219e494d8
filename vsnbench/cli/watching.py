"""`vsnbench run --watch`: the same trials again whenever the files of a model change."""

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from vsnbench.end_signals import EndAsked
from vsnbench.errors import ExitCode, UsageError
from vsnbench.scratch import ScratchDirectory

PASSING = "VSNBENCH_PASSING_RESULTS"
"""Set in the environment of a run whose results are thrown away when it is run again."""
_LOOK_AGAIN_S = 0.3


def run_and_watch(
    model: str, robot: str, cluster: str, results: Path | None, database: str | None, files: Sequence[Path | None]
) -> int:
    """Run the command that was typed, and again after every change, until it is interrupted; return the exit code.

    Args:
        model: `package.module:Class`.
        robot: as it was typed.
        cluster: as it was typed.
        results: where results were asked to go.
        database: as it was typed.
        files: further files that the model is made from.

    Raises:
        UsageError: it is no simulated run of one class, or no file is found to be watched.
    """
    if not robot.startswith("simulated"):
        raise UsageError(f"--watch with --robot {robot}: only a simulated robot may start by itself")
    if cluster or "," in model or ":" not in model or model.startswith(("ws://", "wss://")):
        raise UsageError("--watch runs one class of your own, on this machine: --model package.module:Class")
    if results is not None or database is not None:
        raise UsageError("--watch throws its results away", advice="leave out --results and --db, or --watch")
    watched = [*_sources(model), *(file for file in files if file is not None)]
    console = Console(file=sys.stderr, highlight=False, soft_wrap=True)
    again = [sys.executable, "-m", "vsnbench.cli.main", *(word for word in sys.argv[1:] if word != "--watch")]
    asked = EndAsked()
    with ScratchDirectory("watch") as held, asked.listening():
        scratch = held.path
        while not asked:
            seen = _state(watched)
            shutil.rmtree(scratch / "results", ignore_errors=True)
            code = _run([*again, "--fail-fast", "--results", str(scratch / "results")], asked)
            if asked:
                break
            mark = "[green]passed[/green]" if code == 0 else f"[red]exit code {code}[/red]"
            where = f"waiting for a change of {escape(_words(watched))}; Ctrl-C ends it"
            console.print(f"{mark}; {where}")
            while not asked.wait(_LOOK_AGAIN_S) and _state(watched) == seen:
                pass
    return ExitCode.INTERRUPTED


def _run(command: Sequence[str], asked: EndAsked) -> int:
    with subprocess.Popen(command, env=os.environ | {PASSING: "1"}) as child:
        while child.poll() is None:
            if asked.wait(_LOOK_AGAIN_S):
                child.terminate()  # it halts its robot and keeps its record; Ctrl-C at a terminal has told it already
                return child.wait()
        return child.returncode


def _sources(model: str) -> Iterator[Path]:
    """Yield what is watched for a class: its package's directory, or that beside its file."""
    top = model.partition(":")[0].partition(".")[0]
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    spec = importlib.util.find_spec(top)
    if spec is None:
        raise UsageError(f"--model {model}: no module {top} in {here}, nor installed")
    if spec.submodule_search_locations:
        yield from map(Path, spec.submodule_search_locations)
    elif spec.origin is not None:
        yield Path(spec.origin).parent


def _state(watched: Iterable[Path]) -> frozenset[tuple[str, int, int]]:
    """Return name, time and size of every file that is watched."""
    found = set()
    for place in watched:
        for file in [place] if not place.is_dir() else place.rglob("*.py"):
            try:
                stat = file.stat()
            except OSError:  # an editor is just replacing it
                continue
            found.add((str(file), stat.st_mtime_ns, stat.st_size))
    return frozenset(found)


def _words(watched: Iterable[Path]) -> str:
    return ", ".join(
        str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path) for path in watched
    )
