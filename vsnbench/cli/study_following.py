"""What is done with a locked study: run, status, amend, unblind, report."""

import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import (
    RECORD_PANEL,
    Console,
    ConsoleAddress,
    ConsoleCertificate,
    ConsoleKey,
    ConsolePort,
    Database,
    Results,
    operator_page,
)
from vsnbench.cli.output import Json, print_files, print_json
from vsnbench.cli.study_report import StudyFormat

if TYPE_CHECKING:
    from vsnbench.cli.study_file import OpenedStudy

File = Annotated[Path, typer.Argument(help="The study's file.")]
_DEFAULT = Path("study.yaml")


def add_to(app: typer.Typer) -> None:
    """Give the verbs to `vsnbench study`."""
    for function in (run, status, amend, unblind, report):
        app.command()(function)


def run(
    file: File = _DEFAULT,
    only_next: Annotated[bool, typer.Option("--only-next", help="One trial, then stop.")] = False,
    until: Annotated[
        str, typer.Option("--until", metavar="HH:MM", help="Begin no trial from then on, by this machine's clock.")
    ] = "",
    model_memory: Annotated[
        float | None,
        typer.Option("--model-memory", min=0.1, metavar="GIB", help="For the loaded models; half of it when absent."),
    ] = None,
    unattended: Annotated[bool, typer.Option("--unattended", help="Nobody is beside a real robot.")] = False,
    live: Annotated[
        bool, typer.Option("--live", help="Show each episode in Rerun as it happens.", rich_help_panel=RECORD_PANEL)
    ] = False,
    results: Results = None,
    db: Database = None,
    console: Console = False,
    console_address: ConsoleAddress = "",
    console_port: ConsolePort = None,
    console_certificate: ConsoleCertificate = None,
    console_key: ConsoleKey = None,
    as_json: Json = False,
) -> None:
    """Run a locked study; it goes on where it was, and changes the models by itself.

    [bold]vsnbench study run study.yaml --until 18:00[/bold]
    """
    import threading

    from vsnbench.cli.run_summary import leave_strays_behind
    from vsnbench.cli.study_file import open_study
    from vsnbench.cli.study_running import run_and_tell
    from vsnbench.errors import StudyError
    from vsnbench.runner.attendance import TerminalAttendance

    page = operator_page(console, console_address, console_port, console_certificate, console_key)
    study = open_study(file, results, db)
    if study.changed:
        raise StudyError(study.refusal)
    before = frozenset(threading.enumerate())
    code = run_and_tell(
        study,
        only_next=only_next,
        until=_moment(until),
        memory_bytes=None if model_memory is None else round(model_memory * 2**30),
        attendance=TerminalAttendance(unattended, page),
        live=live,
        as_json=as_json,
    )
    leave_strays_behind(code, before)
    raise typer.Exit(code)


def _moment(text: str) -> datetime | None:
    """Return when the clock next shows this time of the day; an aware moment."""
    from datetime import timedelta

    from vsnbench.errors import UsageError

    if not text:
        return None
    try:
        wanted = datetime.strptime(text, "%H:%M")  # noqa: DTZ007 - a time of the day, on whatever day
    except ValueError as problem:
        raise UsageError(f"--until {text}: give a time of the day, like 18:00") from problem
    now = datetime.now().astimezone()
    then = now.replace(hour=wanted.hour, minute=wanted.minute, second=0, microsecond=0)
    return then if then > now else then + timedelta(days=1)


def status(file: File = _DEFAULT, results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Say how far a study is, and whether it still is what was locked.

    [bold]vsnbench study status study.yaml[/bold]
    """
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, name_column, print_list
    from vsnbench.cli.study_file import open_study
    from vsnbench.database.migrate import open_record
    from vsnbench.database.study_entries import AMEND
    from vsnbench.database.study_queries import trials_of

    study = open_study(file, results, db)
    recorded = study.recorded
    with open_record(study.results.database_url) as engine:
        standing = trials_of(engine, recorded.id)
    amendments = sum(one.kind == AMEND for one in recorded.entries)
    standings = []
    for arm in recorded.arms:
        own = [one for one in standing if one.arm == arm.name]
        done, left, voids = (sum(getattr(one, what) for one in own) for what in ("done", "left", "voids"))
        standings.append({"arm": recorded.shown(arm.name), "done": done, "left": left, "void_attempts": voids})
    if as_json:
        identity = {"study": recorded.title, "locked_at": recorded.locked_at, "locked_sha256": recorded.locked_sha256}
        state = {"sha256": recorded.sha256, "amendments": amendments, "blind": recorded.is_blind}
        print_json({**identity, **state, "changed": study.changed or None, "arms": standings})
        return
    typer.echo(f"study     {safe(recorded.title)}")
    typer.echo(f"locked    {recorded.locked_at:%Y-%m-%d %H:%M} UTC, sha256 {recorded.locked_sha256[:16]}")
    if amendments:
        typer.echo(f"amended   {amendments} times, now sha256 {recorded.sha256[:16]}")
    blind = "yes" if recorded.is_blind else "no" if not recorded.blind else f"until {recorded.unblinded_at:%m-%d %H:%M}"
    typer.echo(f"blind     {blind}")
    done = sum(one.done for one in standing)
    typer.echo(f"trials    {done} of {len(standing)} done, {sum(one.voids for one in standing)} void attempts")
    numbers = (ListColumn(heading, right=True) for heading in ("done", "left", "void attempts"))
    typer.echo()
    print_list((name_column("arm"), *numbers), [[safe(value) for value in line.values()] for line in standings])
    _tell_of_change(study)


def _tell_of_change(study: "OpenedStudy") -> None:
    if study.changed:
        typer.echo(f"vsnbench: warning: {study.refusal}", err=True)


def amend(
    file: File = _DEFAULT,
    reason: Annotated[str, typer.Option("--reason", help="Why the plan is changed; the report tells it.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Let the changed file be the plan from now on; what changed, who changed it and why is kept for the report.

    What the schedule is drawn from (arms, goals, positions, order, seed, site, robot, protocol) stays as it was locked.

    [bold]vsnbench study amend study.yaml --reason "the second operator is ill"[/bold]
    """
    from vsnbench.cli.study_file import open_study
    from vsnbench.database.journal import Journal
    from vsnbench.database.study_entries import StudyChange
    from vsnbench.errors import StudyError, UsageError
    from vsnbench.study.file import parse_study, read_text
    from vsnbench.study.lock import LockNote, changes, check_amendment, sha256_of, write_note

    if not reason.strip():
        raise UsageError("no reason given: --reason 'why the plan is changed', the report tells it")
    study = open_study(file, results, db)
    text = read_text(file)
    lines = changes(study.recorded.content, text)
    if not lines:
        raise StudyError(f"{file} is what was locked: there is nothing to amend")
    amended = parse_study(text, str(file))
    check_amendment(study.plan, amended)
    with Journal.open(study.results.database_url) as journal:
        change = StudyChange(text, sha256_of(text), amended.title, reason.strip(), "\n".join(lines))
        journal.amend_study(study.recorded.id, change)
    note = LockNote(
        study.recorded.uuid, change.sha256, study.recorded.locked_at.isoformat(), study.results.shown_database
    )
    write_note(file, note)
    if as_json:
        print_json({"sha256": change.sha256, "reason": change.reason, "changes": lines})
        return
    for line in lines:
        typer.echo(line)
    typer.echo("amended: the report tells of it", err=True)


def unblind(
    file: File = _DEFAULT,
    reason: Annotated[str, typer.Option("--reason", help="Why people may know now; the report tells it.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Give the arms their names back, for everybody and for ever; before the study is over that is a deviation.

    [bold]vsnbench study unblind study.yaml --reason "all trials are done"[/bold]
    """
    from vsnbench.cli.study_file import forget_blind_copies, open_study
    from vsnbench.database.journal import Journal
    from vsnbench.database.study_entries import OVER
    from vsnbench.database.study_queries import trials_of
    from vsnbench.errors import UsageError

    if not reason.strip():
        raise UsageError("no reason given: --reason 'why people may know now', the report tells it")
    study = open_study(file, results, db)
    with Journal.open(study.results.database_url) as journal:
        standing = trials_of(journal.engine, study.recorded.id)
        journal.unblind_study(study.recorded.id, reason.strip())
    forget_blind_copies(study.results, study.recorded.uuid)
    if as_json:
        print_json({"arms": {arm.code: arm.name for arm in study.recorded.arms}})
    for arm in study.recorded.arms if not as_json else ():
        typer.echo(f"arm {arm.code} is {arm.name}")
    early = any(one.left for one in standing) and not any(one.kind == OVER for one in study.recorded.entries)
    if early:
        typer.echo("vsnbench: warning: trials are left: the report says for ever that this was early", err=True)
    sys.stdout.flush()


def report(
    file: File = _DEFAULT,
    form: Annotated[StudyFormat, typer.Option("--format", "-f", help="What to print on stdout.")] = StudyFormat.TABLE,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write every form into this directory.")] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Report a study: its conclusion, the primary analysis, the locked plan, every deviation; the rest exploratory.

    [bold]vsnbench study report study.yaml --output report/[/bold]
    """
    from vsnbench.cli.study_file import open_study
    from vsnbench.cli.study_report import print_findings, write_findings
    from vsnbench.report.study.findings import read_findings

    study = open_study(file, results, db)
    found = read_findings(study.results.database_url, study.recorded, study.plan, study.changed)
    if output is not None:
        print_files(write_findings(found, output), as_json=as_json)
    else:
        print_findings(StudyFormat.JSON if as_json else form, found)
    _tell_of_change(study)
