"""Summary after a campaign: what is done, what is left and the next command."""

import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import NoReturn, ParamSpec

import typer
from rich.markup import escape

from vsnbench.cli.support.output import is_quiet
from vsnbench.results.files.directory import TEMPORARY_RESULTS, ResultsDirectory
from vsnbench.runner.loop.contract import SessionResult
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.stopping.requests import StopAuthor, Stopped
from vsnbench.runtime.child_process import adopt_orphans, descendants, end_descendants
from vsnbench.text.sanitize import counted, sanitize
from vsnbench.text.terminal import Console

logger = logging.getLogger(__name__)

P = ParamSpec("P")

THREAD_TIMEOUT_S = 2.0
"""Time to wait at exit for threads that a model started."""


def run_and_exit(console: Console, run: Callable[P, int], *arguments: P.args, **options: P.kwargs) -> NoReturn:
    """Run trials and exit with the code that `run` returns, also if threads of a model would keep the process alive.

    If a person or a signal stops the run, the message goes to the console, and the exit code is 129 to 143. Processes
    that a model started are ended, even if their parents have ended: they must not hold a robot, a GPU or a cluster's
    slot after the last trial.
    """
    threads, pids = threading.enumerate(), frozenset(process.pid for process in descendants())
    adopt_orphans()
    try:
        code = run(*arguments, **options)
    except Stopped as stopped:
        request = stopped.request
        by = request.means if request.author is StopAuthor.PERSON else request.description
        console.print(
            f"[yellow]stopped[/yellow] ({by}): the robot is halted and every finished step is recorded. "
            "The same command resumes with the remaining trials."
        )
        code = request.exit_code
    finally:
        names = end_descendants(pids)
        adopt_orphans(wanted=False)
        if names:
            logger.warning("ended processes that the model left running: %s", ", ".join(map(sanitize, names)))
    deadline_s = time.monotonic() + THREAD_TIMEOUT_S
    started = [thread for thread in threading.enumerate() if not thread.daemon and thread not in threads]
    for thread in started:
        thread.join(max(deadline_s - time.monotonic(), 0))
    if alive := [thread.name for thread in started if thread.is_alive()]:
        logger.warning("not waiting for threads that the model left running: %s", ", ".join(alive))
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    raise typer.Exit(code)


def summary_console() -> Console:
    """Return the console of a summary: stderr, or stdout with --quiet, which prints nothing else."""
    stream = sys.stdout if is_quiet() else sys.stderr
    return Console(file=stream, highlight=False, soft_wrap=not stream.isatty())


def print_next(console: Console, command: str) -> None:
    """Print the next command; not with --quiet, because it is not a result."""
    if not is_quiet():
        console.print(f"[dim]next:[/dim] vsnbench {escape(command)}")


def print_awaiting(console: Console, awaiting: int, results: ResultsDirectory) -> None:
    """Print the command that judges episodes, if any await judgement."""
    if awaiting:
        console.print(
            f"[cyan]{counted(awaiting, 'trial')} to be judged[/cyan] before they count: "
            f"vsnbench judge --pending{escape(results.options)}"
        )


def fields_of(result: SessionResult, request: RunRequest) -> dict[str, object]:
    """Return the summary of a campaign as JSON fields."""
    return {
        "model": request.setup.model,
        "site": request.site,
        "seed": request.seed,
        "results": str(request.results.path),
        "campaign": result.campaign_id,
        "trials": result.trials,
        "done": result.trials - result.left - result.elsewhere,
        "left": result.left,
        "elsewhere": result.elsewhere,
        "awaiting_judgement": result.awaiting,
        "episodes_run": result.episodes,
        "void_episodes": result.void,
        "stopped_because": result.stopped_because or None,
    }


def print_summary(console: Console, result: SessionResult, request: RunRequest, following: str = "") -> None:
    """Print what is done, what is left and the next command; `following` replaces the report once nothing is left."""
    trials = result.trials
    if result.stopped_because:
        console.print(f"[red]stopped[/red]: {escape(result.stopped_because)}")
    if os.environ.get(TEMPORARY_RESULTS):  # a run of `--watch`, whose results are discarded at the next change
        console.print(f"{trials - result.left} of {counted(trials, 'trial')} done")
        console.print(f"[dim]until the next change:[/dim] vsnbench episodes list{escape(request.results.options)}")
        return
    if result.left:
        console.print(
            f"[yellow]{result.left} of {counted(trials, 'trial')} left[/yellow]"
            f"{f' ({result.void} void)' if result.void else ''}: the same command resumes."
        )
    if result.elsewhere:
        done = trials - result.left - result.elsewhere
        console.print(
            f"[green]{done} of {counted(trials, 'trial')} done[/green], [yellow]{result.elsewhere} running elsewhere"
            f"[/yellow] ({escape(', '.join(result.holders))}): repeat the command to wait for them and run the rest."
        )
    if not result.left and not result.elsewhere:
        all_trials = "the only trial is" if trials == 1 else f"all {trials} trials are"
        if result.episodes:
            place = str(request.results.path) if request.results.has_own_database else request.results.database_label
            console.print(f"[green]{all_trials} done[/green]; results in {escape(place)}")
        else:
            console.print(
                f"nothing to do: {all_trials} done. Add goals, --starts or --repetitions, or use another --seed."
            )
    print_awaiting(console, result.awaiting, request.results)
    if following and not result.left and not result.elsewhere:
        print_next(console, following)
        return
    only_void = result.episodes == result.void > 0 and result.left == trials
    print_next(console, f"{'episodes list --outcome void' if only_void else 'report'}{request.results.options}")
