"""`vsnbench study`: comparisons of models from a plan that is locked before the first trial."""

import sys
from enum import StrEnum
from shlex import quote
from typing import Annotated

import typer

from vsnbench.cli.study import locked
from vsnbench.cli.study.locked import DEFAULT_FILE, File
from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import (
    Database,
    Rehearse,
    Results,
    SimulatedSite,
    configured_option,
    results_directory,
)
from vsnbench.cli.support.output import Json, print_files, print_json, without_prints_of_models
from vsnbench.cli.support.terminal import page
from vsnbench.config import BUILT_IN_ROBOT, BUILT_IN_SITE
from vsnbench.errors import StudyError, UsageError

app = typer.Typer(no_args_is_help=True)


class StoppingChoice(StrEnum):
    """When a study ends."""

    PLAN = "plan"
    DECIDED = "decided"


@app.command()
def new(  # noqa: PLR0913 - Typer needs a parameter per option
    file: File = DEFAULT_FILE,
    title: Annotated[str, typer.Option("--title", help="Title, without names of models; operators see it.")] = "",
    question: Annotated[str, typer.Option("--question", help="Question of the study.")] = "",
    arm: Annotated[
        list[str] | None,
        typer.Option("--arm", help="Models to compare, two to twelve, with optional names.", metavar="[NAME=]MODEL"),
    ] = None,
    goal: Annotated[
        list[str] | None, typer.Option("--goal", "-g", metavar="A,B", help="Goal categories that all arms share.")
    ] = None,
    starts: Annotated[
        list[str] | None,
        typer.Option(
            "--starts", metavar="N,N-M", show_default="all of the site", help="Starting positions, like 1-15,20."
        ),
    ] = None,
    repetitions: Annotated[
        int,
        typer.Option("--repetitions", min=1, max=1000, help="Repetitions of each goal from each starting position."),
    ] = 1,
    site: SimulatedSite = BUILT_IN_SITE,
    robot: Annotated[str, configured_option("robot", "-r", help="Robot, as for `vsnbench run`.")] = BUILT_IN_ROBOT,
    seed: Annotated[
        int,
        typer.Option(
            "--seed", min=0, max=2**63 - 1, metavar="N", help="Seed of the schedule, the codes and the trials."
        ),
    ] = 0,
    stopping: Annotated[
        StoppingChoice,
        typer.Option("--stopping", help="End of the study: after all trials (plan), or once it is decided."),
    ] = StoppingChoice.PLAN,
    twin: Annotated[
        int | None,
        typer.Option(
            "--twin", min=6, metavar="N", help="Real trials in N random cells; simulated ones predict the rest."
        ),
    ] = None,
    no_blind: Annotated[bool, typer.Option("--no-blind", help="Show operators which model drives.")] = False,
    operator: Annotated[
        list[str] | None, typer.Option("--operator", metavar="A,B", help="Names of the operators.")
    ] = None,
    rehearse: Rehearse = False,
    as_json: Json = False,
) -> None:
    """Write a commented study file, from options or a few questions.

    [bold]vsnbench study new --arm il=pirlnav --arm vlv --goal bed,chair --seed 7[/bold]
    """
    from vsnbench.files.atomic import write_atomic
    from vsnbench.models.names import class_of
    from vsnbench.study.file import parse_study
    from vsnbench.study.template import StudyDraft

    if file.exists():
        raise StudyError(f"{file} exists", advice="name another file", code="file-exists")

    def answer(given: str, prompt: str, default: str) -> str:
        """Return the value of an option, else the answer at the terminal, else a default."""
        if given:
            return given
        return str(typer.prompt(prompt, default=default)) if sys.stdin.isatty() else default

    models = split_list(arm)
    if not models and sys.stdin.isatty():
        models = split_list([typer.prompt("Models (two or more, separated by commas)", default="pirlnav, vlv")])
    if not models:
        raise UsageError("no arms given", advice="name two or more models, like --arm il=pirlnav --arm vlv")
    arms: dict[str, str] = {}
    for text in models:
        name, given, model = text.partition("=")
        name, model = (name, model) if given else (_arm_name(text), text)
        if name in arms:
            raise UsageError(
                f"two arms have the name {name}", advice=f"rename one, like {name}2={model}", code="equal-arms"
            )
        if same := next((arm for arm, other in arms.items() if class_of(other) == class_of(model)), None):
            raise UsageError(
                f"arms {same} and {name} are the same model, {model}",
                advice="name another; for two settings of one model, edit the study file",
                code="equal-arms",
            )
        arms[name] = model
    goals = split_list(goal) or split_list([answer("", "Goals", "bed, chair, sofa, toilet")])
    draft = StudyDraft(
        title=answer(title, "Title", f"Which of {len(arms)} models finds its goal?"),
        question=answer(question, "Question", "Which of the models succeeds more often on our robot, in our flat?"),
        arms=arms,
        goals=goals,
        site=site,
        robot=robot,
        starts=",".join(starts or ()),
        repetitions=repetitions,
        real_cells=twin,
        seed=seed,
        blind=not no_blind,
        stopping=stopping.value,
        operators=split_list(operator),
        rehearse=rehearse,
    )
    text = draft.text(str(file))
    parse_study(text, str(file))
    write_atomic(file, text.encode())
    print_files([file], as_json=as_json)
    typer.echo(f"next: edit it, then vsnbench study check {quote(str(file))}", err=True)


def _arm_name(model: str) -> str:
    """Return the name of an arm: the class of `package.module:Class`, or the host of an address."""
    from vsnbench.models.names import is_address

    last = model.rsplit("/", 1)[-1].rsplit(":", 1)
    text = last[0] if is_address(model) else last[-1]
    return "".join(mark if mark.isalnum() or mark in "_.-" else "-" for mark in text)


@app.command()
def check(file: File = DEFAULT_FILE, as_json: Json = False) -> None:
    """Check a study file: its site, robot, models and goals.

    [bold]vsnbench study check study.yaml[/bold]
    """
    from vsnbench.cli.study.text import arm_fields, arm_lines, warnings_of
    from vsnbench.runner.study.arms import StudyPlace
    from vsnbench.runner.study.locking import locked_arms
    from vsnbench.study.file import parse_study, read_text

    study = parse_study(read_text(file), str(file))
    place = StudyPlace.of(study, file.parent)
    with without_prints_of_models(as_json=as_json):
        arms = locked_arms(place)
    trials = len(place.schedule.trials)
    cells = len({(trial.goal, trial.start) for trial in place.schedule.trials})
    warnings = list(warnings_of(place))
    if place.design_error:
        warnings.append(
            f"this design cannot show a difference: {place.design_error}; `study lock` refuses it without --force"
        )
    if as_json:
        size = {"trials": trials, "cells": cells, "repetitions": study.repetitions}
        rules = {"order": study.order, "seed": study.seed, "stopping": study.stopping}
        print_json({"arms": arm_fields(arms), **size, **rules, "warnings": warnings})
        return
    for line in arm_lines(arms):
        typer.echo(line)
    repetitions = f" x {study.repetitions} repetitions" if study.repetitions > 1 else ""
    typer.echo(
        f"{trials} trials in {cells} cells{repetitions}: {study.order}, seed {study.seed}, stopping: {study.stopping}"
    )
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)
    typed = quote(str(file))
    typer.echo(f"next: vsnbench study plan {typed}, then vsnbench study lock {typed}", err=True)


@app.command()
def plan(
    file: File = DEFAULT_FILE,
    rate: Annotated[float, typer.Option("--rate", min=0.01, max=0.99, help="Assumed mean success rate.")] = 0.5,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.1, show_default="as in the record", help="Duration of a trial in seconds."),
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Estimate the power of a study by simulation, and its duration.

    [bold]vsnbench study plan study.yaml --rate 0.6[/bold]
    """
    from vsnbench.cli.study.pilot import recorded_pairs
    from vsnbench.cli.study.text import PLAN, duration_line, power_table, powers_of
    from vsnbench.report.study.pilot import pilot_table
    from vsnbench.report.table import print_tables
    from vsnbench.runner.study.arms import StudyPlace
    from vsnbench.study.file import parse_study, read_text

    study = parse_study(read_text(file), str(file))
    place = StudyPlace.of(study, file.parent)
    if len({block.start for block in place.shared_blocks}) < 2:
        raise StudyError(
            f"{file}: 1 starting position is too few: places cannot be told from models",
            advice="plan more starting_positions",
            code="too-few-units",
        )
    powers, directory = powers_of(place, rate), results_directory(results, db)
    table = power_table(place, rate, powers)
    pace = duration_line(place, directory, seconds)
    pairs = recorded_pairs(place, directory)
    if as_json:
        found = {"rate": rate, "power": powers, "notes": table.notes, "pace": pace}
        print_json(PLAN.fields({**found, "pilot": pairs if study.of_progress else None}))
        return
    print_tables([table, *([pilot_table(pairs, study)] if pairs else [])], page())
    if study.of_progress and not pairs:
        typer.echo(
            f"the record has no two models with progress in the same cells of {place.site.name} on these goals: what "
            "progress saves against success is unknown"
        )
    typer.echo(pace)


@app.command()
def lock(
    file: File = DEFAULT_FILE,
    force: Annotated[bool, typer.Option("--force", help="Lock a design that cannot show a difference.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Lock a study: hash its models, draw the schedule and the codes, and write them into the record.

    Later changes of the file are detected; `vsnbench study amend` records them for the report.

    [bold]vsnbench study lock study.yaml --results /data/apartment[/bold]
    """
    from vsnbench.cli.study.file import study_of_file, write_lock_file
    from vsnbench.cli.study.text import warnings_of
    from vsnbench.runner.study import locking
    from vsnbench.runner.study.arms import StudyPlace
    from vsnbench.study.file import parse_study, read_text
    from vsnbench.study.lock import note_path, read_note

    text = read_text(file)
    if read_note(file) is not None:
        raise StudyError(
            f"{file} is already locked ({note_path(file)})", advice=f"run it: vsnbench study run {quote(str(file))}"
        )
    study = parse_study(text, str(file))
    where = results_directory(results, db)
    if known := study_of_file(text, where):
        write_lock_file(file, where, known.uuid)
        typer.echo(f"{file} is already locked: wrote {note_path(file)} again from the record", err=True)
        print_files([note_path(file)], as_json=as_json)
        return
    place = StudyPlace.of(study, file.parent)
    if place.design_error and not force:
        raise StudyError(
            f"{file}: this design cannot show a difference: {place.design_error}", advice="--force locks it anyway"
        )
    for warning in warnings_of(place):
        typer.echo(f"warning: {warning}", err=True)
    with without_prints_of_models(as_json=as_json):
        recorded = locking.lock(place, text, where)
    write_lock_file(file, where, recorded.uuid)
    codes = [arm.code for arm in recorded.arms] if recorded.blind else []
    if as_json:
        fields = {"sha256": recorded.sha256, "schedule_sha256": recorded.schedule_sha256, "blind": recorded.blind}
        print_files([note_path(file)], as_json=True, **fields, trials=len(place.schedule.trials), codes=codes)
        return
    typer.echo(f"locked  {file}  sha256 {recorded.sha256}")
    typer.echo(f"trials  {len(place.schedule.trials)}, schedule {recorded.schedule_sha256[:12]}")
    if codes:
        typer.echo(f"blind   operators see arm {', arm '.join(codes)}")
    typer.echo(f"next: vsnbench study run {quote(str(file))}{where.options}", err=True)


for _function in (locked.run, locked.status, locked.amend, locked.unblind, locked.report):
    app.command()(_function)
