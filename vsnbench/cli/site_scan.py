"""`vsnbench sites scan`: drive a robot through a place, and write the map that its depth camera makes of it."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import RobotOrProfile
from vsnbench.cli.output import Json, print_json
from vsnbench.lab_file import BUILT_IN_ROBOT, BUILT_IN_SITE

if TYPE_CHECKING:
    from vsnbench.cli.scan_progress import ScanProgress
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.site import Site
    from vsnbench.robots.contract import Robot
    from vsnbench.runner.scan import Driver, ScanResult


def command(
    robot: RobotOrProfile = BUILT_IN_ROBOT,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Where to: a map.yaml that is not there yet, its PGM beside it.")
    ] = Path("scan.yaml"),
    site: Annotated[
        str, typer.Option("--site", help="Where a simulated robot drives: embedded site, a site file, or twin:N.")
    ] = "",
    start: Annotated[int, typer.Option("--start", help="The site's starting position to begin at.")] = 1,
    drive: Annotated[
        Path | None, typer.Option("--drive", help="Read the actions from a file: around, forward 3, left ...")
    ] = None,
    auto: Annotated[
        bool, typer.Option("--auto", help="A simulated robot drives by itself, until nothing new is seen.")
    ] = False,
    max_steps: Annotated[
        int, typer.Option("--max-steps", min=1, max=100_000, help="With --auto or --drive: end after so many actions.")
    ] = 2000,
    resolution: Annotated[float, typer.Option(min=0.02, max=0.2, help="Side of a cell, metres.")] = 0.05,
    noise: Annotated[bool, typer.Option("--noise", help="Noisy depth and odometry in simulation.")] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the noise.")] = 0,
    as_json: Json = False,
) -> None:
    """Drive a robot through a place by hand, and write the map that its depth camera makes of it.

    Each key is one movement: arrows or w a s d; o turns once around, the space bar halts, q ends. Forward moves are
    refused before obstacles. Ctrl-C ends too; the map so far is kept on every way out.

    The map is in the frame of where the robot began, or of the site's where one is named: begin square to a wall. It
    is a ROS map, which `vsnbench sites edit` takes as underlay.

    [bold]Examples[/bold]

        vsnbench sites scan --robot turtlebot2 --output lab-map.yaml

        vsnbench sites scan --site apartment --auto --output scan.yaml

        vsnbench sites edit lab.yaml --underlay scan.yaml
    """
    from rich.console import Console

    from vsnbench.errors import RobotError, UsageError
    from vsnbench.exchange.ros_map import write_ros_map
    from vsnbench.harmless_text import counted
    from vsnbench.protocol.observation import Sensor
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.site import StartingPosition
    from vsnbench.robots.registry import is_simulated, open_robot
    from vsnbench.runner.scan import MOST_ACTIONS, Scan
    from vsnbench.runner.selection import named_site
    from vsnbench.runner.stopping import Stopping
    from vsnbench.sensing.wall_lines import propose_walls

    image = output.with_suffix(".pgm")
    if output.suffix not in (".yaml", ".yml"):
        raise UsageError(f"cannot write a map to {output}", advice="name a file that ends in .yaml")
    for path in (output, image):
        if path.exists():
            raise UsageError(f"{path} is there already", advice="name another file with --output")
    place = named_site(site or BUILT_IN_SITE) if site or is_simulated(robot) else None
    parameters = ProtocolParameters()
    with (
        Stopping() as stop,
        open_robot(robot, place, parameters, noise=noise, read=frozenset({Sensor.DEPTH, Sensor.ODOMETRY})) as opened,
    ):
        stop.last_acts.append(opened.halt)
        if place is None and opened.identity.simulated:
            place = _played_site(opened)
        mark = place.start(start) if place else StartingPosition(number=1, position=(0, 0), heading_deg=0)
        scan = Scan(opened, mark, parameters, stop, resolution_m=resolution, seed=seed)
        with _driver(opened, parameters, drive, auto=auto) as (driver, progress):
            limit = max_steps if auto or drive else MOST_ACTIONS
            try:
                result = scan.run(driver, lambda grid: write_ros_map(grid, output), progress.tell, limit)
            except RobotError:
                if output.exists():
                    typer.echo(f"what was mapped until then is kept: {output}, {image}", err=True)
                raise
    walls = propose_walls(result.grid)
    doors = sum(len(wall.doorways) for wall in walls)
    if as_json:
        print_json(
            {
                "files": [str(output), str(image)],
                "actions": result.actions,
                "seen_free_m2": round(result.seen_free_m2, 2),
                "walls": len(walls),
                "doors": doors,
                "odometry_off_m": round(math.hypot(*result.drift.position), 3),
                "odometry_off_deg": round(result.drift.heading_deg, 2),
                "corrections_refused": result.refused,
                "failed_movements": result.failed,
                "stopped": result.stopped.request.words if result.stopped else None,
            }
        )
    else:
        console = Console(highlight=False, soft_wrap=True)
        if result.stopped:
            console.print(f"{result.stopped.request.words}; the map so far is kept")
        console.print(f"{output}, {image}: {result.actions} actions, {result.seen_free_m2:.1f} m² of floor seen")
        console.print(_drift_in_words(result))
        proposed = f"{counted(len(walls), 'wall')} and {counted(doors, 'door')} proposed"
        console.print(f"{proposed}: vsnbench sites edit lab.yaml --underlay {output}")
    if result.stopped:
        raise typer.Exit(result.stopped.request.exit_code)


def _played_site(robot: "Robot") -> "Site":
    """Return the embedded site that a simulator beyond ROS plays: it puts the robot at a start of it.

    Raises:
        UsageError: it plays another, which has to be named.
    """
    from vsnbench.errors import UsageError
    from vsnbench.protocol.site import embedded_sites, load_site

    for name in embedded_sites():
        if (site := load_site(name)).sha256 == robot.identity.site_sha256:
            return site
    raise UsageError(
        f"robot {robot.identity.profile.name} is simulated, in a site of your own",
        advice="name the site that it plays with --site, and where it begins with --start",
    )


def _drift_in_words(result: "ScanResult") -> str:
    off_m, off_deg = math.hypot(*result.drift.position), abs(result.drift.heading_deg)
    if off_m < 0.02 and off_deg < 0.5:
        return "odometry and the walls agree"
    words = f"odometry alone would be {off_m:.2f} m and {off_deg:.1f}° off by now; the walls corrected it"
    if result.refused:
        words += f", but for {result.refused} look{'s' if result.refused > 1 else ''} whose correction was implausible"
    return words


@contextmanager
def _driver(
    robot: "Robot", parameters: "ProtocolParameters", drive: Path | None, *, auto: bool
) -> "Iterator[tuple[Driver, ScanProgress]]":
    """Give whoever drives, and where it is shown."""
    from vsnbench.cli.scan_progress import ScanProgress
    from vsnbench.errors import UsageError
    from vsnbench.runner.scan_drivers import Explorer, Script
    from vsnbench.runner.scan_keys import HELP, Keys

    if auto and drive:
        raise UsageError("--auto and --drive both say where to go: name one")
    if auto and not robot.identity.simulated:
        raise UsageError(
            f"robot {robot.identity.profile.name} is real: --auto is for simulated ones", advice="drive it by hand"
        )
    if auto or drive:
        base = robot.identity.profile.base
        with ScanProgress() as progress:
            yield Explorer(base, parameters) if drive is None else Script.of_file(drive, parameters), progress
    else:
        with Keys(parameters, robot.halt) as keys, ScanProgress(HELP) as progress:
            yield keys, progress
