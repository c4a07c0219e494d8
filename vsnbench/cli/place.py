"""`vsnbench place`: look from a mark and say how far off it the robot stands."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results, RobotOrProfile
from vsnbench.cli.output import Json, print_json
from vsnbench.lab_file import BUILT_IN_ROBOT, BUILT_IN_SITE, VARIABLE_OF


def command(
    start: Annotated[int, typer.Option("--start", help="Number of the starting position that the robot stands at.")],
    robot: RobotOrProfile = BUILT_IN_ROBOT,
    site: Annotated[
        str,
        typer.Option(
            "--site",
            envvar=VARIABLE_OF["site"],
            show_envvar=False,
            help="Embedded site, a site file, or twin:N, a generated flat.",
        ),
    ] = BUILT_IN_SITE,
    turn: Annotated[
        bool, typer.Option("--turn", help="Turn once around on the spot and measure from all of it.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Write what it sees with what it should see over it, as PNG.")
    ] = None,
    within: Annotated[
        float | None, typer.Option("--within", min=0.01, max=1, help="Tolerance in metres; the protocol's is 0.10.")
    ] = None,
    within_deg: Annotated[
        float | None, typer.Option("--within-deg", min=0.1, max=45, help="Tolerance in degrees; the protocol's is 3.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of where near its mark a simulated robot was put.")] = 0,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Measure from the depth camera how far off its mark the robot stands, and say how to mend it.

    What the camera sees is compared with what the site's plan says it should see
    from there. Nothing is driven, but for the turn on the spot that --turn asks
    for. The exit code is 0 when it stands right, else 1.

    [bold]Examples[/bold]

        vsnbench place --start 3 --robot turtlebot2 --site lab.yaml

        vsnbench place --start 3 --robot turtlebot2 --site lab.yaml --turn

        vsnbench place --start 3 --robot simulated --picture look.png
    """
    from rich.console import Console

    from vsnbench.errors import RobotError
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.placement import PlacementTolerance
    from vsnbench.record.mark_photos import MarkPhotos
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.robots.registry import is_simulated, open_robot
    from vsnbench.runner.placing import Placing
    from vsnbench.runner.selection import named_site
    from vsnbench.runner.stopping import Stopping
    from vsnbench.runner.terminal_placing import say_placement

    usual = PlacementTolerance()
    tolerance = PlacementTolerance(
        distance_m=usual.distance_m if within is None else within,
        heading_deg=usual.heading_deg if within_deg is None else within_deg,
    )
    parameters = ProtocolParameters(placement=tolerance)
    place = named_site(site)
    mark = place.start(start)
    where = ResultsDirectory.locate(results, db)
    with (
        Stopping() as stop,
        open_robot(robot, place, parameters, pretend_real=is_simulated(robot)) as opened,
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
        say_placement(look.measured, console)
        if look.measured.wants_turn:
            console.print("[dim]next: the same command with --turn[/dim]")
        if picture is not None:
            console.print(f"what it sees, and what it should see in cyan: {picture}")
    raise typer.Exit(0 if look.measured.within_tolerance else 1)
