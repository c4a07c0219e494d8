"""`vsnbench import`: import results of other tools."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.support.options import Database, Results, results_directory
from vsnbench.cli.support.output import Json, print_result

app = typer.Typer(no_args_is_help=True)


@app.command()
def ros4vsn(
    directory: Annotated[Path, typer.Argument(help="Log directory of ROS4VSN, with datos.csv and rgb/.")],
    model: Annotated[str, typer.Option("--model", "-m", help="Name of the model that drove.")],
    site: Annotated[
        str, typer.Option("--site", help="Site name or file; any other name for a place without a survey.")
    ] = "unsurveyed",
    robot: Annotated[str, typer.Option("--robot", help="Profile of the robot.")] = "turtlebot2",
    start: Annotated[int, typer.Option("--start", min=0, help="Number of the starting position; 0 if unknown.")] = 0,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Import episodes of ROS4VSN; they await judgement.

    Example: [bold]vsnbench import ros4vsn ~/ros4vsn/log --model vlv --site lab.yaml[/bold]
    """
    from vsnbench.interop.importing import import_upstream_log, unsurveyed_site
    from vsnbench.interop.upstream_log import read_upstream_log
    from vsnbench.results.writing.journal import Journal
    from vsnbench.robots.profiles import load_profile
    from vsnbench.sites.site import embedded_sites, load_site

    episodes = read_upstream_log(directory)
    surveyed = site in embedded_sites() or Path(site).suffix in (".yaml", ".yml")
    place = load_site(site) if surveyed else unsurveyed_site(site)
    profile = load_profile(robot)
    target = results_directory(results, db)
    target.prepare()
    with Journal.open(target.database_url) as journal:
        campaign, numbers = import_upstream_log(
            journal,
            target.path,
            episodes,
            model=model,
            site=place,
            robot=profile,
            source=directory / "datos.csv",
            start=start,
        )
    pictures = sum(len(episode.pictures) for episode in episodes)
    text = (
        f"{len(numbers)} episodes from {numbers[0]} to {numbers[-1]} in campaign {campaign}, {pictures} pictures; "
        f"they await judgement: vsnbench judge --pending{target.options}"
    )
    print_result({"campaign": campaign, "episodes": numbers, "pictures": pictures}, text, as_json=as_json)


@app.command()
def habitat(
    file: Annotated[Path, typer.Argument(help="JSON with a list of episodes: goal, success, number of steps.")],
    model: Annotated[str, typer.Option("--model", "-m", help="Name of the model, as in the real results.")],
    max_steps: Annotated[
        int, typer.Option("--max-steps", min=1, max=100_000, help="Maximum number of actions per episode in that run.")
    ],
    success_distance: Annotated[
        float, typer.Option("--success-distance", min=0.01, max=10, help="Success distance of that run in metres.")
    ],
    site: Annotated[str, typer.Option("--site", help="Name for the scenes.")] = "habitat",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Import results of Habitat, for the comparison of real and simulated trials (paper, Table 3).

    Each episode needs object_category (or goal), success (0 or 1) and num_steps; distance_to_goal, path_length and
    geodesic_distance are optional. The file does not contain the protocol; the options describe it.

    Example: [bold]vsnbench import habitat results.json --model pirlnav --max-steps 500 --success-distance 1[/bold]
    """
    from vsnbench.interop.habitat import read_habitat
    from vsnbench.interop.importing import import_habitat, unsurveyed_site
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.results.writing.journal import Journal

    episodes = read_habitat(file)
    protocol = ProtocolParameters(max_actions=max_steps, success_distance_m=success_distance)
    place = unsurveyed_site(site)
    target = results_directory(results, db)
    target.prepare()
    with Journal.open(target.database_url) as journal:
        campaign, numbers = import_habitat(journal, episodes, model=model, site=place, source=file, protocol=protocol)
    text = f"{len(numbers)} episodes from {numbers[0]} to {numbers[-1]} in campaign {campaign}"
    print_result({"campaign": campaign, "episodes": numbers}, text, as_json=as_json)
