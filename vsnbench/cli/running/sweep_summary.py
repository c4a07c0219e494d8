"""Runs a sweep from the terminal: prints its estimated duration first and a summary at the end."""

import sys
from collections.abc import Sequence

from rich.markup import escape

from vsnbench.cli.running.summary import fields_of, print_next, summary_console
from vsnbench.cli.support.output import is_quiet, print_json, silence, without_prints_of_models
from vsnbench.results.database_url import sqlite_path
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.throughput import NO_THROUGHPUT, Throughput, throughput_of
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.schema.migrate import schema_state
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.sweep import Cost, Sweep, Swept, cost_of, plan_sweep, run_sweep, undone
from vsnbench.runner.setup.sweep_timing import time_models, untimed_models
from vsnbench.text.sanitize import counted
from vsnbench.text.terminal import Console
from vsnbench.viewer.live import RerunEpisodes

TIMING_THRESHOLD_S = 600.0
"""For longer sweeps, one trial of each model without episodes is timed first."""


def run_sweep_and_report(
    request: RunRequest, models: Sequence[str], seeds: Sequence[int], sites: Sequence[str], *, live: bool, as_json: bool
) -> int:
    """Run a sweep and return the exit code: 0 if every trial is done, 1 if some are left.

    Raises:
        Stopped: a person or the system asked to stop.
    """
    with without_prints_of_models(as_json=as_json):
        swept = run_planned(plan_sweep(request, models, seeds, sites), request, live=live)
    if as_json:
        print_json([_fields_of(campaign) for campaign in swept])
    if not (as_json and is_quiet()):
        print_sweep_summary(summary_console(), swept, request.results)
        print_next(summary_console(), f"report{request.results.options}")
    return 1 if any(undone(swept)) else 0


def run_planned(sweep: Sweep, request: RunRequest, *, live: bool = False) -> list[Swept]:
    """Print the estimated duration of a sweep and run it.

    Args:
        sweep: the campaigns.
        request: options that they share.
        live: show each episode in Rerun.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    console = sweep_console()
    pace = _throughput(request.results)
    cost = cost_of(sweep, pace)
    if cost.seconds > TIMING_THRESHOLD_S and not request.workers.cluster and (untimed := untimed_models(sweep, pace)):
        console.print(f"timing one trial of each model without episodes: {escape(', '.join(untimed))}; not recorded")
        with silence():
            pace = time_models(sweep, pace, OperatorProvider(unattended=True))
        cost = cost_of(sweep, pace)
    console.print(cost_line(cost))
    if note := request.setup.keep.note(request.results.new_record_note):
        console.print(f"[dim]{escape(note)}[/dim]")
    with RerunEpisodes(live=live) as viewer:
        swept = list(run_sweep(sweep, OperatorProvider(), viewer))
        viewer.linger()
    return swept


def sweep_console() -> Console:
    """Return the console of a sweep's progress: stderr."""
    return Console(file=sys.stderr, highlight=False, soft_wrap=not sys.stderr.isatty())


def _fields_of(campaign: Swept) -> dict[str, object]:
    request = campaign.request
    if campaign.session is not None:
        return fields_of(campaign.session, request)
    shared = {"model": request.setup.model, "site": request.site, "seed": request.seed}
    return shared | ({"skipped": True} if campaign.is_skipped else {"error": str(campaign.result)})


def _throughput(results: ResultsDirectory) -> Throughput:
    """Read the throughput of earlier episodes; none without a record, or with one that must be upgraded first."""
    file = sqlite_path(results.database_url)
    if file is not None and not file.is_file():
        return NO_THROUGHPUT
    engine = open_engine(results.database_url, read_only=True)
    try:
        return throughput_of(engine) if schema_state(engine).up_to_date else NO_THROUGHPUT
    finally:
        engine.dispose()


def cost_line(cost: Cost) -> str:
    """Return the size and estimated duration of a sweep in one line."""
    done = f", {cost.done:,} of them done" if cost.done else ""
    size = f"{cost.campaigns:,} campaign{'' if cost.campaigns == 1 else 's'}, up to {cost.trials:,} trials{done}"
    if cost.trials == cost.done:
        return size
    basis = "at 3 s a trial, a guess"
    if cost.known_from:
        basis = f"from {cost.known_from:,} timed episode{'' if cost.known_from == 1 else 's'}"
    return f"{size}: about {_duration(cost.seconds)} on {counted(cost.workers, 'worker')}, {basis}"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"


def print_sweep_summary(console: Console, swept: list[Swept], results: ResultsDirectory) -> None:
    """Print what is done and what is left."""
    for campaign in swept:
        result = campaign.result
        reason = "" if campaign.is_skipped else str(result) if isinstance(result, Exception) else result.stopped_because
        if reason:
            console.print(f"[red]{escape(campaign.request.label)}[/red]: {escape(reason)}")
    left, failed = undone(swept)
    sessions = [campaign.session for campaign in swept if campaign.session is not None]
    trials = sum(session.trials for session in sessions)
    if left or failed:
        failures = f", {counted(failed, 'campaign')} failed" if failed else ""
        console.print(f"[yellow]{left} of {trials:,} trials left{failures}[/yellow]: the same command resumes.")
    else:
        console.print(f"[green]all {trials:,} trials are done[/green]; results in {escape(str(results.path))}")
    if awaiting := sum(session.awaiting for session in sessions):
        console.print(f"[cyan]{awaiting} trials to be judged[/cyan]: vsnbench judge --pending{escape(results.options)}")
