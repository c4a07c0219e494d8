"""`vsnbench browse`: look at a results directory in a browser."""

from contextlib import closing
from typing import Annotated

import typer

from vsnbench.cli.support.options import Database, Results, open_results


def command(
    port: Annotated[int, typer.Option(help="Port; 0 for any free port.", min=0, max=65535)] = 8720,
    results: Results = None,
    db: Database = None,
) -> None:
    """Look at the results in a browser: filter, compare, go through episodes frame by frame, add notes and tags.

    The page follows a run while it goes on. It is served to this machine only; Ctrl-C ends it.

    [bold]Examples[/bold]

        vsnbench browse
        vsnbench browse --results /data/monday --port 0
    """
    from vsnbench.runtime.signals import EndAsked
    from vsnbench.web.results_browser.app import BrowserApp
    from vsnbench.web_server.server import WebServer
    from vsnbench.web_server.session_key import SessionKey

    end_asked = EndAsked()
    with (
        open_results(results, db) as (place, engine),
        end_asked.listening(),
        closing(BrowserApp(place, engine)) as app,
    ):
        key = SessionKey.stored(f"browse {place.path.resolve()} {port}")
        app.prepare()
        with WebServer(app.routes(), key, port=port) as server:
            typer.echo(server.addresses[0])
            typer.echo("serving the results to this machine; Ctrl-C to stop", err=True)
            end_asked.wait()
            typer.echo("", err=True)
