"""`vsnbench doctor`: check a robot and this machine before a session, on one screen."""

from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results

_STYLE = {"ok": "green", "warning": "yellow", "failed": "red"}


def command(
    robot: Annotated[
        str, typer.Option("--robot", "-r", help="turtlebot2, lola2, turtlebot4, the path of a profile, or simulated.")
    ] = "turtlebot2",
    move: Annotated[
        bool, typer.Option("--move", help="Turn the robot 30° to the left and back, to see the odometry follow.")
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")] = False,
) -> None:
    """Look at every part that a session needs; each line is ok, a warning or failed, with what to do about it.

    The exit code is 0 when nothing failed, else 1.

    [bold]Examples[/bold]

        vsnbench doctor --robot turtlebot2

        vsnbench doctor --robot lola2 --move

        vsnbench doctor --robot turtlebot4@robot1

        vsnbench doctor --robot simulated
    """
    import json
    from dataclasses import asdict

    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from vsnbench.record.results import ResultsDirectory
    from vsnbench.robots.check_result import CheckResult, Health
    from vsnbench.robots.profiles import load_profile
    from vsnbench.robots.ros1_checkup import check_ros_robot
    from vsnbench.robots.ros2_checkup import check_ros2_robot
    from vsnbench.runner.machine_checkup import check_machine

    simulated = robot.partition(":")[0] == "simulated"
    profile = None if simulated else load_profile(robot)
    checks: list[CheckResult] = list(check_machine(ResultsDirectory.locate(results, db)))
    if profile is not None:
        speaks_ros2 = profile.interface is not None and profile.interface.kind == "ros2"
        checks += (check_ros2_robot if speaks_ros2 else check_ros_robot)(profile, move=move)
    failed = sum(check.health is Health.FAILED for check in checks)
    if as_json:
        typer.echo(json.dumps([asdict(check) for check in checks], indent=2))
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
    who = "this machine" if profile is None else f"{profile.title} and this machine"
    if failed:
        console.print(f"[red]{failed} failed[/red]: {who} cannot run a session yet")
    else:
        console.print(
            f"[green]ready[/green]: {who}"
            + (f", with {warnings} warning{'' if warnings == 1 else 's'}" if warnings else "")
        )
    raise typer.Exit(1 if failed else 0)
