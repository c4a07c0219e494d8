"""`vsnbench view`: open a recorded episode in Rerun."""

from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_files


def command(
    episode: Annotated[int, typer.Argument(help="The episode's number, as in `vsnbench episodes list`.", min=1)],
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser on 127.0.0.1; Ctrl-C ends it.")] = False,
    port: Annotated[int, typer.Option(help="Port for --web; 0 for any that is free.", min=0, max=65535)] = 9090,
    path: Annotated[bool, typer.Option("--path", help="Print the file and open nothing.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Open a recorded episode in Rerun.

    What the robot saw, the floor plan with the way it went, its actions, why it chose them, and the verdict. The file
    is built from the record when it is missing, broken, or older than the verdict that stands.

    [bold]Examples[/bold]

    vsnbench view 17                      in Rerun's own window

    vsnbench view 17 --web                in a browser on this machine

    vsnbench view 17 --web --port 8080    the same on another port

    vsnbench view 17 --path               only print which file it is
    """
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.viewer.rebuild import current_recording
    from vsnbench.viewer.viewers import WebViewer, open_window

    recording = current_recording(ResultsDirectory.locate(results, db), episode)
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
            typer.echo(f"Episode {episode} is served there, to this machine only. Ctrl-C ends it.", err=True)
            served.wait()
    except KeyboardInterrupt:
        typer.echo("", err=True)
