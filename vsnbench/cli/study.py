"""`vsnbench study`: an experiment as a plan that is locked before the first trial."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli import study_following
from vsnbench.cli.options import Database, PlayedSite, Results
from vsnbench.cli.output import Json, print_files, print_json
from vsnbench.lab_file import BUILT_IN_ROBOT, BUILT_IN_SITE, VARIABLE_OF

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

File = Annotated[Path, typer.Argument(help="The study's file.")]
_DEFAULT = Path("study.yaml")


class Stopping(StrEnum):
    """When a study ends."""

    PLAN = "plan"
    DECIDED = "decided"


@app.command()
def new(
    file: File = _DEFAULT,
    title: Annotated[str, typer.Option("--title", help="A line; operators see it: name no model in it.")] = "",
    question: Annotated[str, typer.Option("--question", help="What the study is to answer.")] = "",
    arm: Annotated[
        list[str] | None, typer.Option("--arm", help="A model, or NAME=MODEL; two to twelve.", metavar="[NAME=]MODEL")
    ] = None,
    goal: Annotated[list[str] | None, typer.Option("--goal", "-g", help="Shared goals, also with commas.")] = None,
    starts: Annotated[
        str, typer.Option("--starts", help="Starting positions, like 1-15,20; all of the site's when absent.")
    ] = "",
    repetitions: Annotated[int, typer.Option("--repetitions", min=1, max=1000)] = 1,
    site: PlayedSite = BUILT_IN_SITE,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            "-r",
            envvar=VARIABLE_OF["robot"],
            show_envvar=False,
            help="As `vsnbench run` takes it.",
        ),
    ] = BUILT_IN_ROBOT,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**63 - 1, metavar="N")] = 0,
    stopping: Annotated[Stopping, typer.Option("--stopping", help="When it ends.")] = Stopping.PLAN,
    open_: Annotated[bool, typer.Option("--open", help="People see which model drives.")] = False,
    operator: Annotated[list[str] | None, typer.Option("--operator", help="Who runs it.")] = None,
    pretend_real: Annotated[
        bool, typer.Option("--pretend-real", help="A rehearsal: a simulated robot that you place and judge.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Write a commented study file, from options or a few questions.

    [bold]vsnbench study new --arm il=pirlnav --arm vlv --goal bed,chair --seed 7[/bold]
    """
    from vsnbench.errors import StudyError, UsageError
    from vsnbench.study.file import parse_study
    from vsnbench.study.template import study_text
    from vsnbench.whole_files import write_whole

    if file.exists():
        raise StudyError(f"{file} is there already, and is not overwritten: name another file")

    def asked(given: str, words: str, default: str) -> str:
        if given:
            return given
        return str(typer.prompt(words, default=default)) if sys.stdin.isatty() else default

    named = list(arm or ())
    if not named and sys.stdin.isatty():
        named = str(typer.prompt("Which models? (two or more, with commas)", default="pirlnav, vlv")).split(",")
    if not named:
        raise UsageError("no arms: name two models or more, --arm il=pirlnav --arm vlv")
    arms: dict[str, str] = {}
    for one in named:
        name, given, model = one.strip().partition("=")
        if name in arms:
            raise UsageError(f"arm {name} is named twice: give one of them another name, like {name}2={model or name}")
        arms[name if given else _name_of(name)] = model if given else name
    goals = [part.strip() for text in goal or () for part in text.split(",") if part.strip()]
    if not goals:
        goals = [part.strip() for part in asked("", "Which goals?", "bed, chair, sofa, toilet").split(",")]
    text = study_text(
        file=str(file),
        title=asked(title, "A title?", f"Which of {len(arms)} models finds its goal?"),
        question=asked(question, "The question?", "Which of the models succeeds more often on our robot, in our flat?"),
        arms=arms,
        goals=goals,
        site=site,
        robot=robot,
        starts=starts,
        repetitions=repetitions,
        seed=seed,
        blind=not open_,
        stopping=stopping.value,
        operators=operator or (),
        pretend_real=pretend_real,
    )
    parse_study(text, str(file))
    write_whole(file, text.encode())
    print_files([file], as_json=as_json)
    typer.echo(f"next: read it, then vsnbench study check {file}", err=True)


def _name_of(model: str) -> str:
    """Return a name for an arm from its model's: the class of `package.module:Class`, the host of an address."""
    last = model.rsplit("/", 1)[-1].rsplit(":", 1)
    text = last[0] if model.startswith(("ws://", "wss://")) else last[-1]
    return "".join(mark if mark.isalnum() or mark in "_.-" else "-" for mark in text)


@app.command()
def check(file: File = _DEFAULT, as_json: Json = False) -> None:
    """See that everything in a study file is there and fits together: site, robot, models, goals.

    [bold]vsnbench study check study.yaml[/bold]
    """
    from vsnbench.cli.study_words import arm_fields, arm_lines, warnings_of
    from vsnbench.runner.study_arms import StudyPlace
    from vsnbench.runner.study_locking import locked_arms
    from vsnbench.study.file import parse_study, read_text

    study = parse_study(read_text(file), str(file))
    place = StudyPlace.of(study, file.parent)
    arms = locked_arms(place)
    trials, blocks = len(place.schedule.trials), len({one.block for one in place.schedule.trials})
    if as_json:
        told = {"trials": trials, "cells": blocks, "order": study.order, "seed": study.seed}
        doubts = list(warnings_of(place))
        print_json({"arms": arm_fields(arms), **told, "stopping": study.stopping, "warnings": doubts})
        return
    for line in arm_lines(arms):
        typer.echo(line)
    typer.echo(f"{trials} trials in {blocks} cells: {study.order}, seed {study.seed}, stopping: {study.stopping}")
    for words in warnings_of(place):
        typer.echo(f"warning: {words}", err=True)
    typer.echo(f"next: vsnbench study plan {file}, then vsnbench study lock {file}", err=True)


@app.command()
def plan(
    file: File = _DEFAULT,
    rate: Annotated[float, typer.Option("--rate", min=0.01, max=0.99, help="Mean success rate assumed.")] = 0.5,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.1, help="For a trial; the record's own pace when absent.")
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Say what a study's design can show, by simulating it and its own test, and how long it takes.

    [bold]vsnbench study plan study.yaml --rate 0.6[/bold]
    """
    from vsnbench.cli.episode_page import page
    from vsnbench.cli.study_words import pace_words, power_sheet
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.report.sheets import print_sheets
    from vsnbench.runner.study_arms import StudyPlace
    from vsnbench.study.file import parse_study, read_text

    study = parse_study(read_text(file), str(file))
    place = StudyPlace.of(study, file.parent)
    sheet = power_sheet(place, rate)
    pace = pace_words(place, ResultsDirectory.locate(results, db), seconds)
    if as_json:
        names = ("difference_percent", "power_percent", "blocks")
        rows = [dict(zip(names, (cell.key for cell in line.cells), strict=True)) for line in sheet.rows]
        print_json({"rate": rate, "power": rows, "notes": list(sheet.notes), "pace": pace})
        return
    print_sheets([sheet], page())
    typer.echo(pace)


@app.command()
def lock(file: File = _DEFAULT, results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Freeze a study: load and hash its models, draw the schedule and the codes, write it into the record.

    From then on a change of the file is noticed; `vsnbench study amend` makes one, and the report tells of it.

    [bold]vsnbench study lock study.yaml --results /data/apartment[/bold]
    """
    from vsnbench.cli.study_words import warnings_of
    from vsnbench.errors import StudyError
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.runner import study_locking
    from vsnbench.runner.study_arms import StudyPlace
    from vsnbench.study.file import parse_study, read_text
    from vsnbench.study.lock import LockNote, note_path, read_note, write_note

    text = read_text(file)
    if read_note(file) is not None:
        raise StudyError(f"{file} is locked already ({note_path(file)}): vsnbench study run {file}")
    study = parse_study(text, str(file))
    place = StudyPlace.of(study, file.parent)
    where = ResultsDirectory.locate(results, db)
    for words in warnings_of(place):
        typer.echo(f"warning: {words}", err=True)
    locked = study_locking.lock(place, text, where)
    write_note(file, LockNote(locked.uuid, locked.sha256, locked.locked_at.isoformat(), where.shown_database))
    codes = [arm.code for arm in locked.arms] if locked.blind else []
    if as_json:
        told = {"sha256": locked.sha256, "schedule_sha256": locked.schedule_sha256, "blind": locked.blind}
        print_files([note_path(file)], as_json=True, **told, trials=len(place.schedule.trials), codes=codes)
        return
    typer.echo(f"locked  {file}  sha256 {locked.sha256}")
    typer.echo(f"trials  {len(place.schedule.trials)}, schedule {locked.schedule_sha256[:12]}")
    if codes:
        typer.echo(f"blind   people see arm {', arm '.join(codes)}")
    typer.echo(f"next: vsnbench study run {file}{where.options}", err=True)


study_following.add_to(app)
