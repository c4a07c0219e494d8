"""`vsnbench doctor`: check a robot and this machine before a session."""

from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import Database, Results, RobotOrProfile
from vsnbench.cli.support.output import Json, print_json
from vsnbench.config import CHECKED_ROBOT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.robots.checkup.result import CheckResult

_EPISODE_BYTES = 40 * 2**20
_FULL_CAMPAIGN = 90
_STYLE = {"ok": "green", "warning": "yellow", "failed": "red"}


def command(
    robot: RobotOrProfile = CHECKED_ROBOT,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model", "-m", metavar="A,B", help="Models whose training camera is compared with the robot's camera."
        ),
    ] = None,
    move: Annotated[
        bool,
        typer.Option(
            "--move",
            help="Turn the robot 30° to the left and back to check odometry, and measure its watchdog.",
        ),
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Check every part that a session needs. Each line is ok, a warning or failed, with advice.

    The exit code is 0 if no check failed, else 1.

    [bold]Examples[/bold]

        vsnbench doctor --robot turtlebot2

        vsnbench doctor --robot lola2 --move

        vsnbench doctor --robot turtlebot4@robot1

        vsnbench doctor --robot simulated

        vsnbench doctor --robot turtlebot2 --model pirlnav
    """
    from dataclasses import asdict

    from rich.markup import escape
    from rich.table import Table

    from vsnbench.models.description import describe_model
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.robots.checkup.check_up import check_up
    from vsnbench.robots.checkup.result import CheckResult, Health
    from vsnbench.robots.checkup.trained_camera import trained_camera_result
    from vsnbench.robots.profiles import load_profile
    from vsnbench.robots.registry import profile_of
    from vsnbench.text.terminal import Console

    simulated = robot.partition(":")[0] == "simulated"
    profile = None if simulated else load_profile(robot)
    checks: list[CheckResult] = list(_check_machine(ResultsDirectory.locate(results, db)))
    if profile is not None:
        checks += check_up(profile, move=move)
    checks += [
        trained_camera_result(name, describe_model(name).card, seen.camera)
        for name in split_list(model)
        if (seen := profile or profile_of(robot)) is not None
    ]
    failed = sum(check.health is Health.FAILED for check in checks)
    if as_json:
        print_json([asdict(check) for check in checks])
        raise typer.Exit(1 if failed else 0)
    console = Console(highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for check in checks:
        advice = f"\n[bold]→[/bold] {escape(check.advice)}" if check.advice else ""
        style = _STYLE[check.health]
        table.add_row(f"[{style}]{check.health}[/]", check.what, escape(check.seen) + advice)
    console.print(table)
    warnings = sum(check.health is Health.WARNING for check in checks)
    subject = "this machine" if profile is None else f"{profile.title} and this machine"
    if failed:
        console.print(f"[red]{failed} failed[/red]: {subject} cannot run a session yet")
    else:
        console.print(
            f"[green]ready[/green]: {subject}"
            + (f", with {warnings} warning{'' if warnings == 1 else 's'}" if warnings else "")
        )
    raise typer.Exit(1 if failed else 0)


def _check_machine(results: "ResultsDirectory") -> "Iterator[CheckResult]":
    """Check free disk space, and that the record can be written."""
    from vsnbench.errors import VsnbenchError
    from vsnbench.results.writing.journal import Journal
    from vsnbench.robots.checkup.result import CheckResult, Health

    try:
        results.prepare()
    except VsnbenchError as error:
        yield CheckResult(
            "results", Health.FAILED, error.statement, error.advice or "choose another directory with --results"
        )
        return
    episodes = results.free_bytes() // _EPISODE_BYTES
    seen = f"{results.path}: {results.free_bytes() / 2**30:.1f} GiB free, room for about {episodes} episodes"
    if episodes < _FULL_CAMPAIGN:
        yield CheckResult("disk", Health.WARNING, seen, f"a campaign of {_FULL_CAMPAIGN} episodes may not fit")
    else:
        yield CheckResult("disk", Health.OK, seen)
    try:
        with Journal.open(results.database_url):
            pass
    except VsnbenchError as error:
        yield CheckResult("database", Health.FAILED, error.statement, error.advice or "see docs/results.md")
    else:
        yield CheckResult("database", Health.OK, f"{results.database_label} can be written")
