"""Says after a campaign what is done, what is left and what to type next."""

import logging
import os
import sys
import threading
import time

from rich.console import Console
from rich.markup import escape

from vsnbench.cli.watching import PASSING
from vsnbench.runner.launch import Launched
from vsnbench.runner.request import RunRequest
from vsnbench.runner.stopping import StopAuthor, Stopped

logger = logging.getLogger(__name__)

STRAY_TIMEOUT_S = 2.0
"""How long threads that a model started are waited for when all is done."""


def stopped_words(stopped: Stopped) -> str:
    """Return what is said when somebody has stopped a run."""
    by = stopped.request.means if stopped.request.author is StopAuthor.PERSON else stopped.request.words
    return (
        f"[yellow]stopped[/yellow] ({by}): the robot is halted and every finished step is recorded. "
        "The same command goes on with the trials that are left."
    )


def leave_strays_behind(code: int, before: frozenset[threading.Thread]) -> None:
    """End the process with this exit code if threads that were not there before would keep it alive.

    A model's own threads must not hold a terminal, a robot or a cluster's slot after the last trial.
    """
    give_up_s = time.monotonic() + STRAY_TIMEOUT_S
    strays = [thread for thread in threading.enumerate() if not thread.daemon and thread not in before]
    for thread in strays:
        thread.join(max(give_up_s - time.monotonic(), 0))
    if alive := [thread.name for thread in strays if thread.is_alive()]:
        logger.warning("threads that the model left running are not waited for: %s", ", ".join(alive))
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def fields_of(launched: Launched, request: RunRequest) -> dict[str, object]:
    """Return what became of a campaign, for scripts."""
    result, trials = launched.result, len(launched.campaign.trials)
    return {
        "model": request.model,
        "site": request.site,
        "seed": request.seed,
        "results": str(request.results.path),
        "campaign": launched.campaign.id,
        "trials": trials,
        "done": trials - result.left - result.elsewhere,
        "left": result.left,
        "elsewhere": result.elsewhere,
        "awaiting_judgement": result.awaiting,
        "episodes_run": result.episodes,
        "void_episodes": result.void,
        "stopped_because": result.stopped_because or None,
    }


def tell(console: Console, launched: Launched, request: RunRequest) -> None:
    """Say what is done, what is left and what to type next."""
    if os.environ.get(PASSING):
        _tell_of_passing(console, launched, request)
        return
    result, trials = launched.result, len(launched.campaign.trials)
    if result.stopped_because:
        console.print(f"[red]stopped[/red]: {escape(result.stopped_because)}")
    if result.left:
        console.print(
            f"[yellow]{result.left} of {_trials(trials)} left[/yellow]"
            f"{f' ({result.void} void)' if result.void else ''}: the same command goes on."
        )
    if result.elsewhere:
        done = trials - result.left - result.elsewhere
        console.print(
            f"[green]{done} of {_trials(trials)} done[/green], [yellow]{result.elsewhere} run elsewhere[/yellow], by "
            f"{escape(', '.join(result.holders))}: the same command tells when they are done, and takes what is left."
        )
    if not result.left and not result.elsewhere:
        if result.episodes:
            console.print(f"[green]{_all(trials)} done[/green]; results in {escape(str(request.results.path))}")
        else:
            console.print(
                f"nothing to do: {_all(trials)} done. Ask for more goals, --starts or --repetitions, "
                "or for another --seed."
            )
    if result.awaiting:
        console.print(
            f"[cyan]{_trials(result.awaiting)} to be judged[/cyan] by a person before it counts: "
            f"vsnbench judge --pending{escape(request.results.options)}"
        )
    only_void = result.episodes == result.void > 0 and result.left == trials
    after = "episodes list --outcome void" if only_void else "report"
    console.print(f"[dim]next:[/dim] vsnbench {after}{escape(request.results.options)}")


def _tell_of_passing(console: Console, launched: Launched, request: RunRequest) -> None:
    """Say what is done, and by what it can be seen for as long as it is there."""
    result, trials = launched.result, len(launched.campaign.trials)
    if result.stopped_because:
        console.print(f"[red]stopped[/red]: {escape(result.stopped_because)}")
    console.print(f"{trials - result.left} of {_trials(trials)} done")
    shown = f"vsnbench episodes list{escape(request.results.options)}"
    console.print(f"[dim]until the next change:[/dim] {shown}")


def _trials(count: int) -> str:
    return f"{count} trial{'' if count == 1 else 's'}"


def _all(trials: int) -> str:
    return "the one trial is" if trials == 1 else f"all {trials} trials are"
