"""`vsnbench import`: take in results of other tools."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_json

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")


@app.command()
def ros4vsn(
    directory: Annotated[Path, typer.Argument(help="Upstream's log folder, with datos.csv and rgb/.")],
    model: Annotated[str, typer.Option("--model", "-m", help="Which model drove.")],
    site: Annotated[
        str, typer.Option("--site", help="A site's name or file; or any name for a place that is not surveyed.")
    ] = "unsurveyed",
    robot: Annotated[str, typer.Option("--robot", help="The robot's profile.")] = "turtlebot2",
    start: Annotated[int, typer.Option("--start", min=0, help="The starting position, if it is known.")] = 0,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Episodes of upstream ROS4VSN, marked as imported and not judged: say what became of them afterwards.

    Example: [bold]vsnbench import ros4vsn ~/ros4vsn/log --model vlv --site lab.yaml[/bold]
    """
    from vsnbench.database.journal import Journal
    from vsnbench.exchange.importing import import_upstream_log, unsurveyed_site
    from vsnbench.exchange.upstream_log import read_upstream_log
    from vsnbench.protocol.site import embedded_sites, load_site
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.robots.profiles import load_profile

    episodes = read_upstream_log(directory)
    surveyed = site in embedded_sites() or Path(site).suffix in (".yaml", ".yml")
    place = load_site(site) if surveyed else unsurveyed_site(site)
    profile = load_profile(robot)
    target = ResultsDirectory.locate(results, db)
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
    if as_json:
        print_json({"campaign": campaign, "episodes": list(numbers), "pictures": pictures})
        return
    typer.echo(
        f"{len(numbers)} episodes from {numbers[0]} to {numbers[-1]} in campaign {campaign}, {pictures} pictures; "
        f"they await a verdict: vsnbench judge --pending{target.options}"
    )


@app.command()
def habitat(
    file: Annotated[Path, typer.Argument(help="JSON with a list of episodes: goal, success, number of steps.")],
    model: Annotated[str, typer.Option("--model", "-m", help="Which model it was; as in the real results.")],
    max_steps: Annotated[
        int, typer.Option("--max-steps", min=1, max=100_000, help="The cap on actions that it was run under.")
    ],
    success_distance: Annotated[
        float, typer.Option("--success-distance", min=0.01, max=10, help="STOP nearer than this succeeded, metres.")
    ],
    site: Annotated[str, typer.Option("--site", help="A name for the scenes.")] = "habitat",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """A simulator's results, for the table of real against virtual (paper, Table 3).

    Each episode needs object_category (or goal), success (0 or 1) and num_steps; distance_to_goal, path_length and
    geodesic_distance are taken where they are given. The file does not say the protocol: you do.

    Example: [bold]vsnbench import habitat results.json --model pirlnav --max-steps 500 --success-distance 1[/bold]
    """
    from vsnbench.database.journal import Journal
    from vsnbench.exchange.habitat import read_habitat
    from vsnbench.exchange.importing import import_habitat, unsurveyed_site
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.record.results import ResultsDirectory

    episodes = read_habitat(file)
    protocol = ProtocolParameters(max_actions=max_steps, success_distance_m=success_distance)
    place = unsurveyed_site(site)
    target = ResultsDirectory.locate(results, db)
    target.prepare()
    with Journal.open(target.database_url) as journal:
        campaign, numbers = import_habitat(journal, episodes, model=model, site=place, source=file, protocol=protocol)
    if as_json:
        print_json({"campaign": campaign, "episodes": list(numbers)})
    else:
        typer.echo(f"{len(numbers)} episodes from {numbers[0]} to {numbers[-1]} in campaign {campaign}")


@app.command()
def withdraw(
    campaign: Annotated[int, typer.Argument(help="The import's campaign, as `import` said and `db status` lists it.")],
    note: Annotated[str, typer.Option("--note", help="Why.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Make all episodes of an import void: they count nowhere any more, and the corrected file can come in.

    Example: [bold]vsnbench import withdraw 4 --note "the wrong checkpoint's results"[/bold]
    """
    from vsnbench.database.journal import Journal
    from vsnbench.database.provenance import gather_provenance
    from vsnbench.record.results import ResultsDirectory

    provenance = gather_provenance()
    with Journal.open(ResultsDirectory.locate(results, db).database_url, provenance) as journal:
        number = journal.withdraw_import(campaign, author=provenance.operator, note=note)
    if as_json:
        print_json({"campaign": campaign, "void_episodes": number})
        return
    typer.echo(f"{number} episodes of campaign {campaign} are void now; `vsnbench judge` can take one back")
