"""`vsnbench place`: measure how far the robot is from its starting position."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.support.options import Database, Results, RobotOrProfile, configured_option, results_directory
from vsnbench.cli.support.output import Json, print_json
from vsnbench.cli.support.terminal import safe
from vsnbench.config import BUILT_IN_ROBOT, BUILT_IN_SITE
from vsnbench.errors import RobotError


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    start: Annotated[int, typer.Option("--start", help="Number of the robot's starting position.")],
    robot: RobotOrProfile = BUILT_IN_ROBOT,
    site: Annotated[
        str, configured_option("site", help="Embedded site, path of a site file, or flat:N (a generated flat).")
    ] = BUILT_IN_SITE,
    turn: Annotated[
        bool, typer.Option("--turn", help="Turn once on the spot and measure from images all around.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="PNG file for the camera image with the expected outlines.")
    ] = None,
    within: Annotated[
        float | None,
        typer.Option("--within", min=0.01, max=1, show_default="0.10", help="Tolerance of the position in metres."),
    ] = None,
    within_deg: Annotated[
        float | None,
        typer.Option("--within-deg", min=0.1, max=45, show_default="3", help="Tolerance of the heading in degrees."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the placement error of a simulated robot.")] = 0,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Measure how far the robot is from its starting position.

    Compares the depth image with what the site's plan predicts. The robot
    does not move, except for the turn of --turn. The exit code is 0 if the
    robot is within tolerance, else 1.

    [bold]Examples[/bold]

        vsnbench place --start 3 --robot turtlebot2 --site lab.yaml

        vsnbench place --start 3 --robot turtlebot2 --site lab.yaml --turn

        vsnbench place --start 3 --robot simulated --picture look.png
    """
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.results.files.mark_photos import MarkPhotos
    from vsnbench.robots.registry import is_simulated, open_robot
    from vsnbench.runner.operator.placing import Placing
    from vsnbench.runner.operator.terminal_placing import print_placement
    from vsnbench.runner.setup.selection import named_site
    from vsnbench.runner.stopping.requests import StopRequests
    from vsnbench.text.terminal import Console
    from vsnbench.values.placement import PlacementTolerance

    default = PlacementTolerance()
    tolerance = PlacementTolerance(
        distance_m=default.distance_m if within is None else within,
        heading_deg=default.heading_deg if within_deg is None else within_deg,
    )
    parameters = ProtocolParameters(placement=tolerance)
    place = named_site(site)
    mark = place.start(start)
    where = results_directory(results, db)
    with (
        StopRequests() as stop,
        open_robot(robot, place, parameters, rehearsal=is_simulated(robot)) as opened,
    ):
        stop.last_acts.append(opened.halt)
        photos = MarkPhotos(where, opened.identity.profile)
        placing = Placing(opened, place, mark, seed, parameters, stop, lambda: photos.find(place, mark))
        look = placing.turn() if turn else placing.look()
    if picture is not None:
        look.write_overlay(picture)
    if look.measured is None:
        raise RobotError(f"start {start}: {look.problem}")
    if as_json:
        print_json(look.measured.as_json())
    else:
        console = Console(highlight=False)
        print_placement(look.measured, console)
        if look.measured.wants_turn:
            console.print("[dim]next: the same command with --turn[/dim]")
        if picture is not None:
            console.print(f"camera image, expected outlines in cyan: {safe(picture)}")
    raise typer.Exit(0 if look.measured.within_tolerance else 1)
