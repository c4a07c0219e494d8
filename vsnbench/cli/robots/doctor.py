"""`vsnbench doctor`: check this machine, and a robot, before a session."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import Database, Results, configured_option, results_directory
from vsnbench.cli.support.output import Json, print_json, without_prints_of_models
from vsnbench.config import BUILT_IN_ROBOT
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vsnbench.robots.checkup.result import CheckResult

_STYLE = {"ok": "green", "warning": "yellow", "absent": "dim", "failed": "red"}


def command(
    robot: Annotated[
        str | None,
        configured_option(
            "robot",
            "-r",
            help="Robot: turtlebot2, lola2, turtlebot4 or the path of a profile. Without it: this machine alone.",
        ),
    ] = None,
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
            help="Turn the robot on the spot, by 30° at most, to check odometry, response and watchdog.",
        ),
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Check this machine, or every part of a robot that a session needs.

    Each line is ok, warning, absent (an optional part is not installed) or failed, with advice. The exit code is 0 if
    no check failed, else 1. --json has the versions for a bug report: no names, no environment.

    [bold]Examples[/bold]

        vsnbench doctor
        vsnbench doctor --json
        vsnbench doctor --robot turtlebot2
        vsnbench doctor --robot lola2 --move
        vsnbench doctor --robot turtlebot4@robot1
        vsnbench doctor --robot turtlebot2 --model pirlnav
    """
    from vsnbench.models.description import describe_model
    from vsnbench.robots.checkup.check_up import check_up
    from vsnbench.robots.checkup.machine import check_installation, check_results
    from vsnbench.robots.checkup.result import Health
    from vsnbench.robots.checkup.trained_camera import trained_camera_result
    from vsnbench.robots.profiles import load_profile
    from vsnbench.robots.registry import profile_of
    from vsnbench.runtime.machine import gather_machine_facts

    simulated = robot is None or robot.partition(":")[0] == BUILT_IN_ROBOT
    if simulated and move:
        raise UsageError("--move needs a robot", advice="name it with --robot")
    profile = None if robot is None or simulated else load_profile(robot)
    facts = gather_machine_facts()
    checks = [
        *(check_installation(facts) if profile is None else ()),
        *check_results(results_directory(results, db)),
    ]
    if profile is not None:
        checks += check_up(profile, move=move)
    with without_prints_of_models(as_json=as_json):
        checks += [
            trained_camera_result(name, describe_model(name).card, seen.camera)
            for name in split_list(model)
            if (seen := profile or profile_of(robot or BUILT_IN_ROBOT)) is not None
        ]
    failed = any(check.health is Health.FAILED for check in checks)
    if as_json:
        subject = {"ready": not failed, "robot": profile.name if profile is not None else None}
        print_json({**subject, "checks": [asdict(check) for check in checks], "machine": asdict(facts)})
    else:
        _print(checks, "this machine" if profile is None else f"{profile.title} and this machine")
    raise typer.Exit(1 if failed else 0)


def _print(checks: "Sequence[CheckResult]", subject: str) -> None:
    """Print a line per check, and the conclusion."""
    from rich.markup import escape
    from rich.table import Table

    from vsnbench.text.terminal import Console

    console = Console(highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for check in checks:
        advice = f"\n[bold]→[/bold] {escape(check.advice)}" if check.advice else ""
        style = _STYLE[check.health]
        table.add_row(f"[{style}]{check.health}[/]", escape(check.what), escape(check.seen) + advice)
    console.print(table)
    if failed := sum(check.health == "failed" for check in checks):
        console.print(f"[red]{failed} failed[/red]: {escape(subject)} cannot run a session yet")
        return
    warnings = sum(check.health == "warning" for check in checks)
    ending = f", with {warnings} warning{'' if warnings == 1 else 's'}" if warnings else ""
    console.print(f"[green]ready[/green]: {escape(subject)}{ending}")
