"""`vsnbench config`: a lab's defaults, and where each comes from."""

from dataclasses import asdict
from pathlib import Path

import typer

from vsnbench.cli.output import Json, print_json

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="""Show a lab's defaults: a flag comes first, then the environment, then vsnbench.toml.

    vsnbench config show
    """,
)


@app.callback()
def config() -> None:
    """Keep `show` a verb of its own."""


@app.command()
def show(as_json: Json = False) -> None:
    """Show every default, and the file or variable that says it.

    [bold]Examples[/bold]

        vsnbench config show
        VSNBENCH_ROBOT=turtlebot2 vsnbench config show --json
    """
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, print_list, prose_column
    from vsnbench.lab_file import FILE_NAME, VARIABLE_OF, lab_defaults

    defaults = lab_defaults()
    if as_json:
        print_json([asdict(each) for each in defaults])
        return
    rows = []
    for each in defaults:
        unsaid = f"[dim]not said: {VARIABLE_OF[each.name]} or vsnbench.toml may[/dim]"
        source = FILE_NAME if each.source == str(Path.cwd() / FILE_NAME) else each.source
        rows.append((each.name, safe(each.value) or "[dim]-[/dim]", safe(source) or unsaid))
    print_list((ListColumn("default"), prose_column("value"), prose_column("from")), rows)
