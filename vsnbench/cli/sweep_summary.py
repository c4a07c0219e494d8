"""Runs a sweep from the terminal: says first what it will cost, asks where that is long, and tells what is left."""

import sys

import typer
from rich.console import Console
from rich.markup import escape

from vsnbench.cli.output import print_json
from vsnbench.cli.run_summary import fields_of, stopped_words
from vsnbench.database.engine import open_engine
from vsnbench.database.migrate import schema_state
from vsnbench.database.pace import NO_PACE, Pace, pace_of
from vsnbench.database_url import sqlite_path
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendance import TerminalAttendance
from vsnbench.runner.request import RunRequest
from vsnbench.runner.stopping import Stopped
from vsnbench.runner.sweep import Cost, Swept, cost_of, plan_sweep, run_sweep, undone
from vsnbench.viewer.live import RerunEpisodes

LONG_S = 3600.0
"""What takes longer is asked for on a terminal."""


def sweep_and_tell(
    request: RunRequest, models: str, seeds: str | None, sites: str | None, *, live: bool, yes: bool, as_json: bool
) -> int:
    """Run a sweep; return the exit code: 0 when every trial is done, 1 when some are left, others when stopped.

    Args:
        request: what its campaigns have in common.
        models: names, separated by commas.
        seeds: numbers and ranges.
        sites: names, and generated flats.
        live: show each episode in Rerun as it happens.
        yes: do not ask, however long it takes.
        as_json: print what became of each campaign, for scripts.
    """
    console = Console(file=sys.stderr, highlight=False, soft_wrap=not sys.stderr.isatty())
    sweep = plan_sweep(request, models, seeds, sites)
    cost = cost_of(sweep, _pace(request.results))
    console.print(cost_words(cost))
    console.print(f"[dim]--record {request.keeps}: {request.keeps.words}[/dim]")
    if cost.seconds > LONG_S and sys.stdin.isatty() and not yes and not typer.confirm("Start?", err=True):
        console.print("nothing was run")
        return 1
    swept: list[Swept] = []
    try:
        with RerunEpisodes(live=live) as viewer:
            swept.extend(run_sweep(sweep, TerminalAttendance(), viewer))
            viewer.linger()
    except Stopped as stopped:
        console.print(stopped_words(stopped))
        return stopped.request.exit_code
    if as_json:
        print_json([_fields_of(one) for one in swept])
    return _tell(console, swept, request.results)


def _fields_of(one: Swept) -> dict[str, object]:
    if one.launched:
        return fields_of(one.launched, one.request)
    return {"model": one.request.model, "site": one.request.site, "seed": one.request.seed, "error": one.error}


def _pace(results: ResultsDirectory) -> Pace:
    """Read the record's own pace; none where there is no record yet, or one that is to be upgraded first."""
    file = sqlite_path(results.database_url)
    if file is not None and not file.is_file():
        return NO_PACE
    engine = open_engine(results.database_url, read_only=True)
    try:
        return pace_of(engine) if schema_state(engine).up_to_date else NO_PACE
    finally:
        engine.dispose()


def cost_words(cost: Cost) -> str:
    """Return what a sweep will take, in a line."""
    campaigns = f"{cost.campaigns:,} campaign{'' if cost.campaigns == 1 else 's'}"
    left = cost.trials - cost.done
    known = f"at this record's pace ({cost.known_from:,} episodes)" if cost.known_from else "at 3 s a trial, a guess"
    on = f"on {cost.workers} worker{'' if cost.workers == 1 else 's'}"
    done = f", {cost.done:,} of them done" if cost.done else ""
    if not left:
        return f"{campaigns}, up to {cost.trials:,} trials{done}"
    return f"{campaigns}, up to {cost.trials:,} trials{done}: about {_time(cost.seconds)} {on}, {known}"


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < LONG_S * 2 else f"{seconds / 3600:.0f} h"


def _tell(console: Console, swept: list[Swept], results: ResultsDirectory) -> int:
    for one in swept:
        because = one.launched.result.stopped_because if one.launched else one.error
        if because:
            where = f"{one.request.model} in {one.request.site} with seed {one.request.seed}"
            console.print(f"[red]{escape(where)}[/red]: {escape(because)}")
    left, failed = undone(swept)
    trials = sum(len(one.launched.campaign.trials) for one in swept if one.launched)
    if left or failed:
        cannot = f", {failed} campaign{'' if failed == 1 else 's'} could not be run" if failed else ""
        console.print(f"[yellow]{left} of {trials:,} trials left{cannot}[/yellow]: the same command goes on.")
    else:
        console.print(f"[green]all {trials:,} trials are done[/green]; results in {escape(str(results.path))}")
    awaiting = sum(one.launched.result.awaiting for one in swept if one.launched)
    if awaiting:
        console.print(f"[cyan]{awaiting} trials to be judged[/cyan]: vsnbench judge --pending{escape(results.options)}")
    console.print(f"[dim]next:[/dim] vsnbench report{escape(results.options)}")
    return 1 if left or failed else 0
