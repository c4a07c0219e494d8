"""Runs a study from the terminal and prints a summary: what is done, what is left and the next command."""

from pathlib import Path

from rich.markup import escape

from vsnbench.cli.running.summary import print_awaiting, print_next, summary_console
from vsnbench.cli.study.file import OpenedStudy
from vsnbench.cli.support.output import is_quiet, print_json, without_prints_of_models
from vsnbench.errors import StudyError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.queries import trials_of, twin_rates
from vsnbench.runner.loop.contract import SessionResult
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.selection import choose_starts
from vsnbench.runner.study.arms import StudyPlace
from vsnbench.runner.study.session import run_study
from vsnbench.runner.study.source import StudyRequest
from vsnbench.study.file import Rate
from vsnbench.text.sanitize import counted
from vsnbench.viewer.live import RerunEpisodes

_FIELDS = ("episodes", "void", "left", "elsewhere", "awaiting", "suspended", "over", "stopped_because")


def place_of(study: OpenedStudy) -> StudyPlace:
    """Return the site and the schedule of a study.

    Raises:
        StudyError: the site or the schedule differs from the locked one.
    """
    place = StudyPlace.of(study.plan, study.file.parent, study.recorded.schedule_sha256)
    if place.schedule.fingerprint != study.recorded.schedule_sha256:
        raise StudyError(
            f"the schedule of {study.file} with its site differs from the locked one",
            advice="restore the site file as it was locked",
            code="schedule-changed",
        )
    return place


def twin_gap(study: OpenedStudy, place: StudyPlace) -> str:
    """Return what the planned twin lacks; empty if nothing, or if the study plans none.

    Raises:
        StudyError: real trials have begun without it (`twin-after-real`).
    """
    plan = study.plan
    if plan.real_cells is None or not isinstance(plan.primary, Rate):
        return ""
    starts = choose_starts(plan.starting_positions, place.site)
    cells = {(goal, start) for goal in plan.goals for start in starts} - set(place.site.excluded)
    with open_record(study.results.database_url) as engine:
        known = twin_rates(engine, study.recorded, plan.primary.arm)
        begun = any(trial.started_at is not None for trial in trials_of(engine, study.recorded.id))
    if not (missing := len(cells - known.keys())):
        return ""
    if begun:
        raise StudyError(
            f"the planned twin lacks {missing} of {len(cells)} cells, and real trials have begun: a twin that is run "
            "after the first of them does not count",
            advice="lock a new study, and run its twin first",
            code="twin-after-real",
        )
    return f"the planned twin lacks simulated trials in {missing} of {len(cells)} cells"


def run_and_report(file: Path, request: StudyRequest, provider: OperatorProvider, *, live: bool, as_json: bool) -> int:
    """Run a study and return the exit code: 0 if nothing is left to run, 1 if trials are left.

    Raises:
        Stopped: a person or the system asked to stop.
    """
    with without_prints_of_models(as_json=as_json), RerunEpisodes(live=live) as viewer:
        result = run_study(request, provider, viewer)
        viewer.linger()
    if not (as_json and is_quiet()):
        _print_summary(file, request.results, result)
    if as_json:
        print_json({"results": str(request.results.path), **{name: getattr(result, name) for name in _FIELDS}})
    return 1 if result.left or result.elsewhere else 0


def _print_summary(file: Path, results: ResultsDirectory, result: SessionResult) -> None:
    console = summary_console()
    if result.stopped_because:
        console.print(f"[yellow]stopped[/yellow]: {escape(result.stopped_because)}")
    if result.over:
        console.print(f"[green]the study is over[/green]: {escape(result.over)}")
    for arm in result.suspended:
        console.print(
            f"[yellow]{escape(arm)} was left out[/yellow]: its model could not be used; the others continued."
        )
    if result.left:
        void = f" ({result.void} void)" if result.void else ""
        console.print(f"[yellow]{counted(result.left, 'trial')} left[/yellow]{void}: the same command resumes.")
    if result.elsewhere:
        console.print(f"[yellow]{counted(result.elsewhere, 'trial')} running elsewhere[/yellow], in another process.")
    if not (result.left or result.elsewhere or result.over):
        console.print(f"[green]every trial is done[/green]; results in {escape(str(results.path))}")
    print_awaiting(console, result.awaiting, results)
    print_next(console, f"study report {file}{results.options}")
