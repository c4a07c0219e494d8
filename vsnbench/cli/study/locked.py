"""Commands for a locked study: run, status, amend, unblind, report."""

from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.listing import name_column, print_list
from vsnbench.cli.support.options import Console, Database, Live, Results, Unattended, operator_page
from vsnbench.cli.support.output import Json, print_files, print_json, print_result
from vsnbench.cli.support.terminal import page, safe
from vsnbench.config import load_config
from vsnbench.errors import StudyError, UsageError
from vsnbench.report.table import Column

if TYPE_CHECKING:
    from vsnbench.cli.study.file import OpenedStudy
    from vsnbench.report.study.findings import StudyFindings


class StudyFormat(StrEnum):
    """Output formats on stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    HTML = "html"
    JSON = "json"


File = Annotated[Path, typer.Argument(help="Path of the study file.")]
DEFAULT_FILE = Path("study.yaml")


def run(  # noqa: PLR0913 - Typer needs a parameter per option
    file: File = DEFAULT_FILE,
    only_next: Annotated[bool, typer.Option("--only-next", help="Stop after one trial.")] = False,
    until: Annotated[
        str, typer.Option("--until", metavar="HH:MM", help="Time of day from which no trial starts (local time).")
    ] = "",
    twin: Annotated[
        bool, typer.Option("--twin", help="Run the simulated trials of the planned twin, before the real ones.")
    ] = False,
    unattended: Unattended = False,
    live: Live = False,
    results: Results = None,
    db: Database = None,
    console: Console = None,
    as_json: Json = False,
) -> None:
    """Run the remaining trials of a locked study; models are changed automatically.

    [bold]vsnbench study run study.yaml --until 18:00[/bold]
    """
    if twin and (only_next or until or console is not None):
        raise UsageError("--twin runs all simulated trials", advice="leave out --only-next, --until and --console")
    from vsnbench.cli.running.run import run_campaign_and_report
    from vsnbench.cli.running.summary import run_and_exit, summary_console
    from vsnbench.cli.study.file import open_study
    from vsnbench.cli.study.running import place_of, run_and_report, twin_gap
    from vsnbench.runner.operator.provider import OperatorProvider
    from vsnbench.runner.study.source import StudyRequest

    page = operator_page(console)
    study = open_study(file, results, db)
    if study.refusal:
        raise StudyError(study.refusal)
    place = place_of(study)
    gap = twin_gap(study, place)
    provider = OperatorProvider(unattended, page.serve if page else None)
    if twin:
        run_and_exit(
            summary_console(),
            run_campaign_and_report,
            place.twin(study.results),
            provider,
            live=live,
            as_json=as_json,
            following=f"study run {quote(str(file))}{study.results.options}",
        )
    if gap:
        advice = f"run them first: vsnbench study run --twin {quote(str(file))}{study.results.options}"
        raise StudyError(gap, advice=advice, code="twin-missing")
    memory_gib = load_config().study.model_memory_gib
    memory_bytes = None if memory_gib is None else round(memory_gib * 2**30)
    request = StudyRequest(study.recorded, place, study.results, only_next, _next_time(until), memory_bytes)
    run_and_exit(summary_console(), run_and_report, study.file, request, provider, live=live, as_json=as_json)


def _next_time(text: str) -> datetime | None:
    """Return the next occurrence of a time of day, as an aware datetime; None for an empty text."""
    if not text:
        return None
    try:
        time = datetime.strptime(text, "%H:%M")  # noqa: DTZ007 - a time of day without a date
    except ValueError as problem:
        raise UsageError(f"cannot read --until {text}", advice="give a time of day, like 18:00") from problem
    now = datetime.now().astimezone()
    then = now.replace(hour=time.hour, minute=time.minute, second=0, microsecond=0)
    return then if then > now else then + timedelta(days=1)


def status(file: File = DEFAULT_FILE, results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Show the progress of a study, and changes since it was locked.

    [bold]vsnbench study status study.yaml[/bold]
    """
    from vsnbench.cli.study.file import open_study
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.results.studies.entries import AMEND
    from vsnbench.results.studies.queries import trials_of
    from vsnbench.results.writing.recovery import lost_episodes
    from vsnbench.study.decision import StoppingDecision
    from vsnbench.study.stopping import decide
    from vsnbench.study.units import shared_blocks

    study = open_study(file, results, db)
    recorded = study.recorded
    with open_record(study.results.database_url) as engine:
        trials, lost = trials_of(engine, recorded.id), lost_episodes(engine)
    decision = StoppingDecision((), {}, "")
    if study.plan.by_looks:
        decision = decide(study.plan, shared_blocks(trials, study.plan.goals))
    amendments = sum(entry.kind == AMEND for entry in recorded.entries)
    arms = []
    for arm in recorded.arms:
        own = [trial for trial in trials if trial.arm == arm.name]
        done, voids = (sum(getattr(trial, field) for trial in own) for field in ("done", "voids"))
        left = sum(trial.left or trial.episode_id in lost for trial in own)
        counts = {"done": done, "left": left, "running": len(own) - done - left, "void_attempts": voids}
        arms.append({"arm": recorded.shown(arm.name), **counts})
    if as_json:
        identity = {"study": recorded.title, "locked_at": recorded.locked_at, "locked_sha256": recorded.locked_sha256}
        state = {"sha256": recorded.sha256, "amendments": amendments, "blind": recorded.is_blind}
        found = {"differences": study.integrity.differences, "remarks": study.integrity.remarks}
        looks = {"looks": decision.looks, "looked": decision.looked}
        print_json({**identity, **state, "changed": study.changed or None, **found, **looks, "arms": arms})
        return
    typer.echo(f"study     {safe(recorded.title)}")
    typer.echo(f"locked    {recorded.locked_at:%Y-%m-%d %H:%M} UTC, sha256 {recorded.locked_sha256[:16]}")
    if amendments:
        typer.echo(f"amended   {amendments} times, now sha256 {recorded.sha256[:16]}")
    blind = "yes" if recorded.is_blind else "no" if not recorded.blind else f"until {recorded.unblinded_at:%m-%d %H:%M}"
    typer.echo(f"blind     {blind}")
    done, voids = sum(trial.done for trial in trials), sum(trial.voids for trial in trials)
    typer.echo(f"trials    {done} of {len(trials)} done, {voids} void attempts")
    if decision.looks:
        done_looks = ", ".join(str(look) for look in decision.looked) or "none yet"
        planned = ", ".join(str(look) for look in decision.looks)
        typer.echo(f"looks     {done_looks}; planned after {planned} starting positions")
    if interrupted := sum(trial.episode_id in lost for trial in trials):
        typer.echo(f"lost      {interrupted} to a process that died; the next `vsnbench study run` repeats them")
    numbers = (Column(heading) for heading in ("done", "left", "running", "void attempts"))
    typer.echo()
    print_list((name_column("arm"), *numbers), [[safe(value) for value in line.values()] for line in arms])
    _print_warnings(study)


def _print_warnings(study: "OpenedStudy") -> None:
    for warning in study.warnings:
        typer.echo(f"vsnbench: warning: {warning}", err=True)


def _check_reason(reason: str, act: str) -> None:
    if not reason.strip():
        raise UsageError("no reason given", advice=f"give the reason for {act} with --reason; the report has it")


def amend(
    file: File = DEFAULT_FILE,
    reason: Annotated[str, typer.Option("--reason", help="Reason for the change; printed in the report.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Accept changes of the study file; the report lists them with author and reason.

    The inputs of the schedule (arms, goals, positions, order, seed, site, robot, protocol) cannot change.

    [bold]vsnbench study amend study.yaml --reason "the second operator is ill"[/bold]
    """
    from vsnbench.cli.study.file import open_study, write_lock_file
    from vsnbench.results.studies.entries import StudyChange
    from vsnbench.results.writing.journal import Journal
    from vsnbench.study.file import parse_study, read_text
    from vsnbench.study.lock import changes, check_amendment, sha256_of

    _check_reason(reason, "the change")
    study = open_study(file, results, db)
    text = read_text(file)
    if study.integrity.differences or study.lacks_note:
        raise StudyError(study.refusal)
    lines = changes(study.recorded.content, text)
    if not lines:
        raise StudyError(f"{file} is as it was locked: nothing to amend", code="nothing-to-amend")
    amended = parse_study(text, str(file))
    check_amendment(study.plan, amended)
    with Journal.open(study.results.database_url) as journal:
        change = StudyChange(text, sha256_of(text), amended.title, reason.strip(), "\n".join(lines))
        journal.amend_study(study.recorded.id, change)
    write_lock_file(file, study.results, study.recorded.uuid)
    fields = {"sha256": change.sha256, "reason": change.reason, "changes": lines}
    print_result(fields, "\n".join(lines), as_json=as_json)
    if not as_json:
        typer.echo("amended; the report lists the change", err=True)


def unblind(
    file: File = DEFAULT_FILE,
    reason: Annotated[str, typer.Option("--reason", help="Reason for unblinding; printed in the report.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Reveal the names of the arms. This is permanent, and a deviation if the study is not over.

    [bold]vsnbench study unblind study.yaml --reason "all trials are done"[/bold]
    """
    from vsnbench.cli.study.file import open_study, remove_blind_copies
    from vsnbench.results.studies.entries import OVER
    from vsnbench.results.studies.queries import trials_of
    from vsnbench.results.writing.journal import Journal

    _check_reason(reason, "unblinding")
    study = open_study(file, results, db)
    with Journal.open(study.results.database_url) as journal:
        trials = trials_of(journal.engine, study.recorded.id)
        journal.unblind_study(study.recorded.id, reason.strip())
    remove_blind_copies(study.results, study.recorded.uuid)
    arms = {arm.code: arm.name for arm in study.recorded.arms}
    text = "\n".join(f"arm {code} is {name}" for code, name in arms.items())
    print_result({"arms": arms}, text, as_json=as_json)
    early = any(trial.left for trial in trials) and not any(entry.kind == OVER for entry in study.recorded.entries)
    if early:
        typer.echo("vsnbench: warning: trials are left; the report marks the unblinding as early", err=True)


def report(
    file: File = DEFAULT_FILE,
    form: Annotated[StudyFormat, typer.Option("--format", "-f", help="Output format on stdout.")] = StudyFormat.TABLE,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory for the report in every format.")
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Report a study: conclusion, primary analysis, locked plan, deviations, exploratory analyses.

    [bold]vsnbench study report study.yaml --output report/[/bold]
    """
    from vsnbench.cli.study.file import open_study
    from vsnbench.files.atomic import write_atomic
    from vsnbench.report.study import forms
    from vsnbench.report.study.findings import read_findings

    study = open_study(file, results, db)
    checked = study.integrity
    found = read_findings(
        *(study.results.database_url, study.recorded, study.plan, study.changed),
        differences=checked.differences,
        remarks=checked.remarks,
    )
    written_as = {
        StudyFormat.HTML: ("study.html", forms.to_html),
        StudyFormat.MARKDOWN: ("study.md", forms.to_markdown),
        StudyFormat.LATEX: ("study.tex", forms.to_latex),
        StudyFormat.JSON: ("study.json", forms.to_json),
    }
    form = StudyFormat.JSON if as_json else form
    if output is not None:
        files = {output / name: write(found).encode() for name, write in written_as.values()}
        for file, content in files.items():
            write_atomic(file, content)
        print_files(files, as_json=as_json)
    elif form is StudyFormat.TABLE:
        _print_findings(found)
    else:
        typer.echo(written_as[form][1](found), nl=False)
    _print_warnings(study)


def _print_findings(found: "StudyFindings") -> None:
    from vsnbench.report.study.tables import study_tables
    from vsnbench.report.table import print_tables

    console = page()
    console.print(f"[bold]{safe(found.recorded.title)}[/bold]")
    console.print(f"[dim]{safe(found.plan.question)}[/dim]\n")
    console.print(f"[bold]{safe(found.conclusion)}[/bold]\n")
    print_tables(study_tables(found), console)
