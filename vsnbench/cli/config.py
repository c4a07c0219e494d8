"""`vsnbench config`: a lab's defaults, and where each comes from."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from vsnbench.cli.output import Json, print_json

if TYPE_CHECKING:
    from vsnbench.lab_file import LabDefault

_BUILT_IN = "built in"

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
    """Show every default that holds here, and the file or variable that says it, or that it is built in.

    [bold]Examples[/bold]

        vsnbench config show
        VSNBENCH_ROBOT=turtlebot2 vsnbench config show --json
    """
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, print_list, prose_column
    from vsnbench.lab_file import FILE_NAME, VARIABLE_OF, lab_defaults

    defaults = [each if each.source else _built_in(each) for each in lab_defaults()]
    if as_json:
        print_json([asdict(each) for each in defaults])
        return
    rows = []
    for each in defaults:
        source = FILE_NAME if each.source == str(Path.cwd() / FILE_NAME) else each.source
        value = each.value.replace(str(Path.home()), "~", 1) if source == _BUILT_IN else each.value
        rows.append((each.name, safe(value), safe(source), VARIABLE_OF[each.name]))
    print_list(
        (ListColumn("default"), prose_column("value"), prose_column("from"), ListColumn("variable", rank=1)), rows
    )


def _built_in(default: "LabDefault") -> "LabDefault":
    """Return what holds where nobody says it."""
    from vsnbench.database.provenance import login_name
    from vsnbench.lab_file import BUILT_IN_RESULTS, BUILT_IN_ROBOT, BUILT_IN_SITE
    from vsnbench.models.weights import weights_directory

    built_in = {
        "site": BUILT_IN_SITE,
        "robot": BUILT_IN_ROBOT,
        "results": BUILT_IN_RESULTS,
        "operator": login_name(),
        "weights": str(weights_directory()),
    }
    return replace(default, value=built_in[default.name], source=_BUILT_IN)
