"""`vsnbench config`: the configuration and where each value comes from."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from vsnbench.cli.support.listing import print_list, prose_column
from vsnbench.cli.support.output import Json, print_json
from vsnbench.cli.support.terminal import safe
from vsnbench.report.table import Column

if TYPE_CHECKING:
    from vsnbench.config import ConfigDefault

_BUILT_IN = "built in"

app = typer.Typer(
    no_args_is_help=True,
    help="""Show the configuration. Options override the environment, which overrides vsnbench.toml.

    vsnbench config show
    """,
)


@app.callback()
def config() -> None:
    """Keep `show` a subcommand, although it is the only one."""


@app.command()
def show(as_json: Json = False) -> None:
    """Show every configured value and its source: a file, a variable, or built in.

    [bold]Examples[/bold]

        vsnbench config show
        VSNBENCH_ROBOT=turtlebot2 vsnbench config show --json
    """
    from vsnbench.config import FILE_NAME, VARIABLE_OF, config_defaults

    defaults = [default if default.source else _built_in(default) for default in config_defaults()]
    defaults += _section_values()
    if as_json:
        print_json([asdict(default) for default in defaults])
        return
    rows = []
    for default in defaults:
        source = FILE_NAME if default.source == str(Path.cwd() / FILE_NAME) else default.source
        value = default.value.replace(str(Path.home()), "~", 1) if source == _BUILT_IN else default.value
        rows.append((default.name, safe(value or "not set"), safe(source), VARIABLE_OF.get(default.name, "")))
    print_list(
        (
            Column("key", number=False),
            prose_column("value"),
            prose_column("from"),
            Column("variable", number=False, rank=1),
        ),
        rows,
    )


def _built_in(default: "ConfigDefault") -> "ConfigDefault":
    """Return a default with its built-in value."""
    from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_RESULTS, BUILT_IN_ROBOT, BUILT_IN_SITE
    from vsnbench.models.checkpoints.weights import weights_directory
    from vsnbench.results.writing.provenance import login_name

    built_in = {
        "site": BUILT_IN_SITE,
        "robot": BUILT_IN_ROBOT,
        "protocol": BUILT_IN_PROTOCOL,
        "results": BUILT_IN_RESULTS,
        "operator": login_name(),
        "weights": str(weights_directory()),
    }
    return replace(default, value=built_in[default.name], source=_BUILT_IN)


def _section_values() -> "list[ConfigDefault]":
    """Return the values of all sections."""
    from vsnbench.config import ConfigDefault, load_config
    from vsnbench.settings.user_config import UserConfig

    config, built_in = load_config(), UserConfig()
    values = []
    for section, model in UserConfig.sections().items():
        for key in model.model_fields:
            value, default = (getattr(getattr(content, section), key) for content in (config, built_in))
            source = _BUILT_IN if value == default else str(config.file)
            values.append(ConfigDefault(f"{section}.{key}", "" if value is None else str(value), source))
    return values
