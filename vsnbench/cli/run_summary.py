"""Runs a campaign from the terminal and says afterwards what is done, what is left and what to type next."""

import sys

from rich.console import Console
from rich.markup import escape

from vsnbench.runner.launch import Launched, RunRequest, launch
from vsnbench.runner.stopping import Stopped
from vsnbench.viewer.live import RerunEpisodes


def run_and_tell(request: RunRequest, *, live: bool) -> int:
    """Run and return the exit code: 0 when every trial is done, 1 when some are left, 130 or 143 when stopped.

    Args:
        request: what to run.
        live: show each episode in Rerun as it happens.
    """
    console = Console(file=sys.stderr, highlight=False, soft_wrap=True)
    try:
        with RerunEpisodes(live=live) as viewer:
            launched = launch(request, viewer)
            viewer.linger()
    except Stopped as stopped:
        console.print(
            f"[yellow]stopped[/yellow] ({stopped}): the robot is halted and every finished step is recorded. "
            "The same command goes on with the trials that are left."
        )
        return 128 + stopped.signal_number
    _tell(console, launched, request)
    return 1 if launched.result.left else 0


def _tell(console: Console, launched: Launched, request: RunRequest) -> None:
    result, trials = launched.result, len(launched.campaign.trials)
    if result.stopped_because:
        console.print(f"[red]stopped[/red]: {escape(result.stopped_because)}")
    if result.left:
        console.print(
            f"[yellow]{result.left} of {trials} trial{'' if trials == 1 else 's'} left[/yellow]"
            f"{f' ({result.void} void)' if result.void else ''}: the same command goes on."
        )
    elif result.episodes:
        console.print(f"[green]{_all(trials)} done[/green]; results in {escape(str(request.results.path))}")
    else:
        console.print(
            f"nothing to do: {_all(trials)} done in this campaign. Another --seed or more --repetitions "
            "makes another campaign."
        )
    console.print(f"[dim]next:[/dim] vsnbench report{escape(request.results.options)}")


def _all(trials: int) -> str:
    return "the one trial is" if trials == 1 else f"all {trials} trials are"
