"""`vsnbench robots`: robot profiles and ROS nodes."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.robots import nodes
from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.cli.support.output import Json, fault_fields, fault_lines, print_json, print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import UsageError

app = typer.Typer(
    no_args_is_help=True,
    help="""List and check robot profiles; run the ROS nodes of a robot.

    vsnbench robots list
    vsnbench robots show --annotated > my-robot.yaml
    vsnbench robots check my-robot.yaml
    vsnbench robots calibrate my-robot.yaml
    vsnbench robots simulate turtlebot2
    vsnbench robots serve turtlebot2
    """,
)

RobotArgument = Annotated[str, typer.Argument(help="Name of a profile, or path of its file.")]


@app.command("list")
def list_robots(as_json: Json = False) -> None:
    """List the values of --robot."""
    from vsnbench.robots.profiles import embedded_profiles, load_profile
    from vsnbench.robots.registry import known_robots
    from vsnbench.robots.ros.interface_kinds import interface_of

    profiles = {name: load_profile(name) for name in embedded_profiles()}
    titles = {name: profile.title for name, profile in profiles.items()}

    def description(name: str) -> str:
        kind, _, profile = name.partition(":")
        if kind == "simulated":
            return f"{titles.get(profile or 'turtlebot2', profile)} in the site's simulated twin, in this process"
        if name not in profiles:
            return "a plug-in"
        return f"{titles[name]} {interface_of(profiles[name]).title if profiles[name].interface else ''}".strip()

    rows = [(name, description(name)) for name in known_robots()]
    if as_json:
        print_json([{"name": name, "what": text} for name, text in rows])
        return
    columns = (name_column("--robot", min_width=24), prose_column("description"))
    print_list(columns, [(safe(name), safe(text)) for name, text in rows])


@app.command()
def show(
    robot: Annotated[str, typer.Argument(help="Name of a profile, or path of its file.")] = "",
    annotated: Annotated[
        bool,
        typer.Option("--annotated", help="Keep the file's comments; without ROBOT, print a commented example."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Print a profile as YAML, with all defaults filled in."""
    from vsnbench.robots.profiles import ANNOTATED_EXAMPLE, load_profile, profile_path
    from vsnbench.settings.yaml_text import dump_yaml

    if annotated:
        if as_json:
            raise UsageError("--annotated and --json exclude each other", advice="JSON has no comments")
        typer.echo((profile_path(robot) if robot else ANNOTATED_EXAMPLE).read_text(encoding="utf-8").rstrip())
        return
    if not robot:
        raise UsageError("no robot profile is named", advice="name one, or pass --annotated for a commented example")
    content = load_profile(robot).model_dump(mode="json")
    print_result(content, dump_yaml(content), as_json=as_json)


@app.command()
def check(robot: RobotArgument, as_json: Json = False) -> None:
    """Check a profile: keys, types, ranges and consistency. Exit code 1 if it is invalid."""
    from vsnbench.robots.checkup.profile import implausible_values
    from vsnbench.robots.profiles import load_profile, profile_faults

    faults = profile_faults(robot)
    if faults:
        fields = {"robot": robot, "title": "", "faults": fault_fields(faults), "warnings": []}
        print_result(fields, "\n".join(fault_lines(robot, faults)), as_json=as_json)
        raise typer.Exit(1)
    profile = load_profile(robot)
    warnings = implausible_values(profile)
    lines = [f"warning: {warning}" for warning in warnings]
    further = f"; check the robot itself: vsnbench doctor --robot {profile.argument}" if profile.interface else ""
    lines += [f"{profile.name}: {profile.title}: the profile is valid{further}"]
    fields = {"robot": profile.name, "title": profile.title, "faults": [], "warnings": warnings}
    print_result(fields, "\n".join(lines), as_json=as_json)


@app.command()
def calibrate(
    robot: RobotArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", show_default="the profile itself", help="File for the corrected profile."),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Write without a confirmation.")] = False,
    as_json: Json = False,
) -> None:
    """Measure the height, tilt, roll and field of view of each camera, and correct the profile.

    Place the robot with 2 m of free floor in front of each camera. It does not move. Comments in the profile are kept.
    The place of a camera on the base is not visible in images of the floor: measure it with a tape.

    [bold]Examples[/bold]

        vsnbench robots calibrate my-robot.yaml

        vsnbench robots calibrate turtlebot4 --output my-turtlebot4.yaml
    """
    from vsnbench.robots.calibration import calibrate as measure
    from vsnbench.robots.calibration import corrections_of, write_corrections
    from vsnbench.robots.profiles import embedded_profiles, load_profile, profile_path

    profile, source = load_profile(robot), profile_path(robot)
    target = output or source
    if target in embedded_profiles().values():
        raise UsageError(
            f"{robot} is an embedded profile and cannot be changed",
            advice=f"name a file for the corrected profile: --output my-{profile.name}.yaml",
        )
    can_ask = sys.stdin.isatty() and not as_json
    if not (yes or can_ask):
        raise UsageError("the correction cannot be confirmed without a terminal", advice="pass --yes to write it")
    measured = measure(profile)
    corrections = corrections_of(measured)
    if not as_json:
        for field, difference in measured.items():
            corrected = f" -> {corrections[field]:g}" if field in corrections else ""
            typer.echo(f"{field}: {difference.text}{corrected}")
    write = yes or not corrections or typer.confirm(f"Write {target}?", err=True)
    if write and (corrections or target != source):
        write_corrections(source, target, corrections)
    if as_json:
        values = {field: asdict(each.measured) | {"profile": each.profile} for field, each in measured.items()}
        fields = {"robot": profile.name, "file": str(target), "written": write}
        print_json({**fields, "measured": values, "corrections": corrections})
    elif not corrections:
        typer.echo("the profile agrees with the camera within the uncertainty of the measurement")
    elif write:
        typer.echo(f"{target} written")


for _function in (nodes.simulate, nodes.serve, nodes.undock):
    app.command()(_function)
