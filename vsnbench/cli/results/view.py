"""`vsnbench view`: open a recorded episode in Rerun."""

from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.options import Database, Results, results_directory
from vsnbench.cli.support.output import Json, print_files
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.results.files.directory import ResultsDirectory


def command(
    numbers: Annotated[
        list[int] | None,
        typer.Argument(
            metavar="EPISODE [EPISODE]",
            help="Numbers of one episode or two, as in `vsnbench episodes list`.",
            min=1,
            show_default=False,
        ),
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser on 127.0.0.1 until Ctrl-C.")] = False,
    port: Annotated[int, typer.Option(help="Port of --web; 0 for any free port.", min=0, max=65535)] = 9090,
    next_failure: Annotated[
        bool, typer.Option("--next-failure", help="Open the first failure after episode N, or the first one.")
    ] = False,
    path: Annotated[bool, typer.Option("--path", help="Print only the path of the recording.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Open a recorded episode in Rerun, or two side by side on one timeline.

    It shows images, the path on the floor plan, actions with the model's reasons, and the verdict. The recording is
    built from the record if it is missing, damaged, or older than the latest verdict.

    [bold]Examples[/bold]

    vsnbench view 17                      in a Rerun window

    vsnbench view 12 47                   two side by side

    vsnbench view 17 --next-failure       the first failure after 17

    vsnbench view 17 --web                in a browser on this machine

    vsnbench view 17 --web --port 8080    the same on another port

    vsnbench view 17 --path               print the path of the recording
    """
    from vsnbench.viewer.rebuild import current_recording
    from vsnbench.viewer.viewers import open_window
    from vsnbench.viewer.web_viewer import WebViewer

    place = results_directory(results, db)
    chosen = _chosen(place, tuple(numbers or ()), next_failure=next_failure)
    if len(chosen) == 1:
        recording = current_recording(place, chosen[0])
    else:
        from vsnbench.viewer.pair import pair_recording

        recording = pair_recording(place, *chosen)
    if path or as_json:
        print_files([recording], as_json=as_json)
        return
    if not web:
        with open_window(recording) as viewer:
            viewer.wait()
        return
    try:
        with WebViewer(port, recording) as served:
            typer.echo(served.address)
            shown = " and ".join(map(str, chosen))
            typer.echo(f"serving episode {shown} to this machine; Ctrl-C to stop", err=True)
            served.wait()
    except KeyboardInterrupt:
        typer.echo("", err=True)


def _chosen(place: "ResultsDirectory", given: tuple[int, ...], *, next_failure: bool) -> tuple[int, ...]:
    """Return one number or two.

    Raises:
        UsageError: not one or two numbers were given, or no later episode failed.
    """
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.results.reading.queries import list_episodes
    from vsnbench.results.schema.migrate import open_record

    most = 1 if next_failure else 2
    if len(given) > most or not (given or next_failure):
        raise UsageError(
            f"{len(given)} episodes given" if given else "no episode given",
            advice="give one number or two; `vsnbench view -h` shows how",
            code="no-episode",
        )
    if not next_failure:
        return given
    after = given[0] if given else 0
    with open_record(place.database_url) as engine:
        failures = list_episodes(engine, EpisodeFilter(outcome="failure"))
    following = next((episode for episode in failures if episode.id > after), None)
    if following is None:
        raise UsageError(
            f"no failure after episode {after}" if after else "no episode failed",
            advice="`vsnbench episodes list --outcome failure` lists the failures",
        )
    typer.echo(f"episode {following.id}: {following.model}, {following.goal}, start {following.start}", err=True)
    return (following.id,)
