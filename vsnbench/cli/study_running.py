"""Runs a study from the terminal and says afterwards what is done, what is left and what to type next."""

import sys
from dataclasses import asdict
from datetime import datetime
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from vsnbench.cli.output import print_json
from vsnbench.errors import StudyError
from vsnbench.runner.attendance import Attendance
from vsnbench.runner.stopping import StopAuthor, Stopped
from vsnbench.runner.study_arms import StudyPlace
from vsnbench.runner.study_session import StudyRequest, StudyResult, run_study
from vsnbench.viewer.live import RerunEpisodes

if TYPE_CHECKING:
    from vsnbench.cli.study_file import OpenedStudy


def run_and_tell(
    study: "OpenedStudy",
    *,
    only_next: bool,
    until: datetime | None,
    memory_bytes: int | None,
    attendance: Attendance,
    live: bool,
    as_json: bool,
) -> int:
    """Run and return the exit code: 0 when nothing more is wanted, 1 with trials left, 129, 130 or 143 when stopped.

    Args:
        study: what to run.
        only_next: one trial.
        until: no trial is begun from then on.
        memory_bytes: for the loaded models; half of the machine's when None.
        attendance: finds whoever is asked to place the robot and to judge: the terminal, a page, or nobody.
        live: show each episode as it happens.
        as_json: print what became of it, for scripts.

    Raises:
        StudyError: the site or the schedule is not what was locked.
    """
    place = StudyPlace.of(study.plan, study.file.parent)
    if place.schedule.fingerprint != study.recorded.schedule_sha256:
        raise StudyError(
            f"the schedule that follows from {study.file} and its site is not the one that was locked: has the site's "
            "file been changed? restore it"
        )
    console = Console(file=sys.stderr, highlight=False, soft_wrap=not sys.stderr.isatty())
    request = StudyRequest(study.recorded, place, study.results, only_next, until, memory_bytes)
    try:
        with RerunEpisodes(live=live) as viewer:
            result = run_study(request, attendance, viewer)
            viewer.linger()
    except Stopped as stopped:
        by = stopped.request.means if stopped.request.author is StopAuthor.PERSON else stopped.request.words
        console.print(
            f"[yellow]stopped[/yellow] ({by}): the robot is halted and every finished step is recorded. "
            "The same command goes on with the trials that are left."
        )
        return stopped.request.exit_code
    _tell(console, study, result)
    if as_json:
        print_json({"results": str(study.results.path), **asdict(result)})
    return 1 if result.left or result.elsewhere else 0


def _tell(console: Console, study: "OpenedStudy", result: StudyResult) -> None:
    if result.stopped_because:
        console.print(f"[yellow]stopped[/yellow]: {escape(result.stopped_because)}")
    if result.over:
        console.print(f"[green]the study is over[/green]: {escape(result.over)}")
    for arm in result.suspended:
        console.print(f"[yellow]{escape(arm)} was left out[/yellow]: its model could not be used; the others went on.")
    if result.left:
        void = f" ({result.void} void)" if result.void else ""
        console.print(f"[yellow]{_trials(result.left)} left[/yellow]{void}: the same command goes on.")
    if result.elsewhere:
        console.print(f"[yellow]{_trials(result.elsewhere)} run elsewhere[/yellow]: another process is at it.")
    if not (result.left or result.elsewhere or result.over):
        console.print(f"[green]every trial is done[/green]; results in {escape(str(study.results.path))}")
    if result.awaiting:
        console.print(
            f"[cyan]{_trials(result.awaiting)} to be judged[/cyan] by a person before it counts: "
            f"vsnbench judge --pending{escape(study.results.options)}"
        )
    console.print(f"[dim]next:[/dim] vsnbench study report {escape(str(study.file))}{escape(study.results.options)}")


def _trials(count: int) -> str:
    return f"{count} trial{'' if count == 1 else 's'}"
