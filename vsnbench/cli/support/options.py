"""Options that several commands share, with the same name, meaning and help."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.support.lists import split_sites
from vsnbench.cli.support.output import is_quiet
from vsnbench.config import BUILT_IN_SITE, VARIABLE_OF, load_config
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from sqlalchemy import Engine

    from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
    from vsnbench.runner.executors.capacity import WorkerOptions
    from vsnbench.settings.user_config import UserConfig
    from vsnbench.web.driver.page import DriverPage
    from vsnbench.web.operator.page import OperatorPage


def options_under(heading: str) -> Callable[..., Any]:
    """Return `typer.Option` for options that `--help` lists under a heading."""
    return partial(typer.Option, rich_help_panel=heading)


def configured_option(name: str, *names: str, **settings: Any) -> Any:
    """Return the option of a value that also a variable or vsnbench.toml can set."""
    return typer.Option(f"--{name}", *names, envvar=VARIABLE_OF[name], show_envvar=False, **settings)


execution_option = options_under("Execution")
record_option = options_under("Record")

Results = Annotated[
    Path | None, record_option("--results", help="Results directory. Default: $VSNBENCH_RESULTS, else ./results.")
]
Database = Annotated[
    str | None,
    record_option(
        "--db",
        metavar="URL",
        help="SQLAlchemy URL of a database (postgresql+psycopg://...) instead of the directory's SQLite file.",
    ),
]
Models = Annotated[list[str] | None, typer.Option("--model", "-m", metavar="A,B", help="Only these models.")]
Goals = Annotated[list[str] | None, typer.Option("--goal", "-g", metavar="A,B", help="Only these goal categories.")]
Sites = Annotated[list[str] | None, typer.Option("--site", metavar="A,B", help="Only these sites.")]
Robots = Annotated[list[str] | None, typer.Option("--robot", metavar="A,B", help="Only these robots.")]
Campaigns = Annotated[
    list[str] | None, typer.Option("--campaign", metavar="N,N-M", help="Only these campaigns, by number.")
]
Console = Annotated[
    str | None,
    execution_option(
        "--console",
        metavar="[ADDRESS:PORT]",
        help="Page for the operator in a browser. Default: 127.0.0.1:8710, or as in vsnbench.toml.",
    ),
]
Live = Annotated[bool, record_option("--live", help="Show each episode in Rerun while it runs.")]
Unattended = Annotated[
    bool, execution_option("--unattended", help="Run a real robot without an operator; its episodes await judgement.")
]
SimulatedSite = Annotated[str, configured_option("site", help="Name of an embedded site, or path of a site file.")]
RobotOrProfile = Annotated[
    str,
    configured_option("robot", "-r", help="Robot: turtlebot2, lola2, turtlebot4, the path of a profile, or simulated."),
]
Protocol = Annotated[
    str,
    configured_option(
        "protocol", metavar="NAME|FILE", help="Rules of the trials: a name of `vsnbench protocol list`, or a YAML file."
    ),
]
Disturb = Annotated[
    list[str] | None,
    execution_option(
        "--disturb",
        metavar="A,B=VALUE,C@SEVERITY",
        help="Disturbances of what the model sees, like blur=2 (in px), glare@4 (severity 1 to 5) or low_light.",
    ),
]
Rehearse = Annotated[
    bool,
    execution_option(
        "--rehearse", help="Rehearse with a simulated robot in real time, which the operator places and judges."
    ),
]

_MAX_WORKERS = 4096
_HOST_AND_PORT = re.compile(r"(?P<host>.*?)(?::(?P<port>\d{1,5}))?")
_LARGEST_PORT = 65535


def results_directory(results: Path | None, db: str | None) -> "ResultsDirectory":
    """Return the directory and the database of `--results` and `--db`, without accessing them."""
    from vsnbench.results.files.directory import ResultsDirectory

    return ResultsDirectory.locate(results, db)


@contextmanager
def open_results(
    results: Path | None, db: str | None, *, reads_copy: bool = True
) -> "Iterator[tuple[ResultsDirectory, Engine]]":
    """Open the existing record of `--results` and `--db` for reading; a deletion that was interrupted is finished.

    Raises:
        RecordError: no record exists, or it cannot be read; see `open_record`.
    """
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.results.writing.deletion import finish_deletions

    place = results_directory(results, db)
    finish_deletions(place)
    with open_record(place.database_url, reads_copy=reads_copy) as engine:
        yield place, engine


def sites_of(values: Sequence[str] | None) -> tuple[str, ...]:
    """Return the sites of `--site`, or the default site.

    Raises:
        UsageError: a value is not a list of sites.
    """
    return split_sites(values) if values else (os.environ.get(VARIABLE_OF["site"]) or BUILT_IN_SITE,)


def operator_page(console: str | None) -> "OperatorPage | None":
    """Return the page of `--console`, with the settings of section `[console]`; None without the option.

    Args:
        console: value of the option: `ADDRESS:PORT`, or empty for the configured address and port.

    Raises:
        UsageError: the value is not an address, or --quiet hides where the page is.
    """
    if console is None:
        return None
    if is_quiet():
        raise UsageError("--quiet hides the address of --console", advice="leave one of them out")
    return _page_at(console)


def _page_at(console: str) -> "OperatorPage":
    from vsnbench.web.operator.page import OperatorPage

    configured = load_config().console
    match = _HOST_AND_PORT.fullmatch(console)
    host = match["host"] if match else ""
    port = int(match["port"]) if match and match["port"] else configured.port
    if match is None or port > _LARGEST_PORT or not host.isascii() or " " in host:
        raise UsageError(
            f"cannot read --console {console!r}", advice="give ADDRESS:PORT, like 0.0.0.0:8710", code="invalid-address"
        )
    address = host.strip("[]") or configured.address
    return OperatorPage(address, port, configured.certificate, configured.key)


def driver_page(model: str, operator: "OperatorPage | None") -> "DriverPage | None":
    """Return the page of a person who drives: where the operator's page is, on the next port; None for a model.

    Args:
        model: value of `--model`.
        operator: the page of `--console`; None for the configured address and port.

    Raises:
        UsageError: --quiet hides where the page is.
    """
    from vsnbench.models.names import is_human

    if not is_human(model):
        return None
    if is_quiet():
        raise UsageError(f"--quiet hides the address of the page of --model {model}", advice="leave --quiet out")
    from vsnbench.web.driver.page import DriverPage

    page = operator or _page_at("")
    port = page.port + 1 if 0 < page.port < _LARGEST_PORT else 0
    return DriverPage(page.address, port, page.certificate, page.private_key)


def what_to_keep(given: str, robot: str, *, live: bool = False, has_operator: bool = False) -> "KeepFiles":
    """Return the value of `--keep`, or its default: copies for Rerun only where an operator is present.

    An unattended simulation makes a copy when an episode is viewed.

    Raises:
        UsageError: the value is unknown, or does not go with `--live`.
    """
    from vsnbench.results.files.directory import KeepFiles
    from vsnbench.robots.registry import is_simulated

    if not given:
        return KeepFiles.ALL if live or has_operator or not is_simulated(robot) else KeepFiles.IMAGES
    if given not in list(KeepFiles):
        raise UsageError(f"--keep {given}: unknown value", advice=f"give {', '.join(KeepFiles)}", code="unknown-value")
    if live and given != KeepFiles.ALL:
        raise UsageError(f"--live shows an episode from its Rerun copy, which --keep {given} does not make")
    return KeepFiles(given)


def of_models(config: "UserConfig") -> dict[str, Any]:
    """Return what section `[models]` says, as fields of `TrialSetupSpec`."""
    from vsnbench.models.fit.camera import Fit

    models = config.models
    return {"device": models.device, "act_timeout_s": models.act_timeout_s, "fit": Fit(models.fit)}


def requested_workers(given: str) -> "WorkerOptions":
    """Return the workers of `--workers`: a number, `auto`, or the address of a Ray cluster.

    Raises:
        UsageError: it is none of them.
    """
    from vsnbench.runner.executors.capacity import WorkerOptions
    from vsnbench.runner.executors.ray_connection import ClusterAddress

    if given.startswith("ray://"):
        cluster = load_config().cluster
        return WorkerOptions(cluster.workers, ClusterAddress.parse(given), cluster.gpus_per_worker)
    if given == "auto":
        return WorkerOptions(None)
    if not given.isdecimal() or not 1 <= int(given) <= _MAX_WORKERS:
        raise UsageError(
            f"cannot read --workers {given}",
            advice=f"give a number from 1 to {_MAX_WORKERS}, auto, or ray://HEAD:PORT",
            code="invalid-workers",
        )
    return WorkerOptions(int(given))
