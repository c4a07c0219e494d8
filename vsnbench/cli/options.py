"""Options that several verbs share, so that one word means the same everywhere."""

from collections import Counter
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.output import is_hushed
from vsnbench.errors import UsageError
from vsnbench.lab_file import VARIABLE_OF

if TYPE_CHECKING:
    from vsnbench.console.operator_page import OperatorPage
    from vsnbench.record.results import Kept
    from vsnbench.simulator.robot_player import SimulationOptions

RECORD_PANEL = "Record"
"""Heading under which `--help` lists them."""

Results = Annotated[
    Path | None,
    typer.Option(
        "--results",
        help="results directory; $VSNBENCH_RESULTS, then ./results, when absent",
        rich_help_panel=RECORD_PANEL,
    ),
]
Database = Annotated[
    str | None,
    typer.Option(
        "--db",
        help="SQLAlchemy URL (postgresql+psycopg://...) in place of the directory's SQLite",
        rich_help_panel=RECORD_PANEL,
    ),
]

PAGE_PANEL = "Console"

Console = Annotated[
    bool,
    typer.Option("--console", help="serve a page for whoever is beside the robot", rich_help_panel=PAGE_PANEL),
]
ConsoleAddress = Annotated[
    str,
    typer.Option(
        "--console-address",
        help="0.0.0.0 for phones in the lab's network; means --console",
        show_default="127.0.0.1",
        rich_help_panel=PAGE_PANEL,
    ),
]
ConsolePort = Annotated[
    int | None,
    typer.Option(
        "--console-port",
        min=0,
        max=65535,
        help="0 for any; means --console",
        show_default="8710",
        rich_help_panel=PAGE_PANEL,
    ),
]
ConsoleCertificate = Annotated[
    Path | None,
    typer.Option("--console-certificate", help="PEM file: the page is served over TLS", rich_help_panel=PAGE_PANEL),
]
ConsoleKey = Annotated[
    Path | None,
    typer.Option("--console-key", help="PEM file of its private key", rich_help_panel=PAGE_PANEL),
]

RobotOrProfile = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        envvar=VARIABLE_OF["robot"],
        show_envvar=False,
        help="turtlebot2, lola2, turtlebot4, the path of a profile, or simulated.",
    ),
]
PlayedSite = Annotated[
    str,
    typer.Option(
        "--site", envvar=VARIABLE_OF["site"], show_envvar=False, help="Embedded site, or the path of a site file."
    ),
]
RateFactor = Annotated[float, typer.Option("--rate-factor", min=0.05, max=20, help="Simulated seconds per second.")]
Noise = Annotated[bool, typer.Option("--noise", help="Odometry that drifts, depth with noise and holes.")]
CommandLag = Annotated[float, typer.Option("--command-lag", min=0, max=1, help="Seconds from a command to its effect.")]
OdometryRate = Annotated[
    float | None, typer.Option("--odometry-rate", min=1, max=50, help="Hz, instead of the profile's.")
]
PretendReal = Annotated[
    bool,
    typer.Option("--pretend-real", help="Play a robot that a person must place: near its marks, not at them."),
]


def operator_page(
    console: bool, address: str, port: int | None, certificate: Path | None, key: Path | None
) -> "OperatorPage | None":
    """Return the page that was asked for; None where none was.

    Raises:
        UsageError: nobody would hear where it is.
    """
    if not (console or address or port is not None or certificate or key):
        return None
    if is_hushed():
        raise UsageError("--quiet hides where the page of --console is", advice="leave one of them out")
    from vsnbench.console.operator_page import DEFAULT_PORT, OperatorPage
    from vsnbench.console.web_server import LOOPBACK

    return OperatorPage(address or LOOPBACK, DEFAULT_PORT if port is None else port, certificate, key)


_MOST_WORKERS = 4096


def refuse_repeated(root: Any, words: Sequence[str]) -> None:
    """Refuse an option that takes one value and was given twice: the parser would take the last without a word.

    Args:
        root: the command line, as Typer builds it.
        words: as typed, without the program's name.

    Raises:
        UsageError: one was; the message names it.
    """
    command: Any = root
    typed = list(takewhile(lambda word: word != "--", words))
    for word in typed:
        command = getattr(command, "commands", {}).get(word, command)
    given = Counter(word.split("=", 1)[0] for word in typed if word.startswith("-"))
    for parameter in command.params:
        once = not (parameter.multiple or getattr(parameter, "is_flag", False) or getattr(parameter, "count", False))
        if once and sum(given[name] for name in parameter.opts) > 1:
            times = sum(given[name] for name in parameter.opts)
            alone = "; every record has a report of its own" if "--results" in parameter.opts else ""
            raise UsageError(
                f"{parameter.opts[0]} was given {times} times, and takes one value", advice=f"give it once{alone}"
            )


def what_is_kept(given: str, *, live: bool) -> "Kept | None":
    """Return what is to be kept of an episode; None where nobody said so.

    Raises:
        UsageError: there is no such word, or it does not go with `--live`.
    """
    from vsnbench.record.results import Kept

    if not given:
        return Kept.FULL if live else None
    if given not in list(Kept):
        raise UsageError(f"--record {given}: say {', '.join(Kept)}")
    if live and given != Kept.FULL:
        raise UsageError(f"--live shows each episode from its copy for Rerun, which --record {given} does not make")
    return Kept(given)


def workers_asked(given: str) -> int | None:
    """Return how many workers were asked for; None for `auto`.

    Raises:
        UsageError: it is no number from 1.
    """
    if given == "auto":
        return None
    if not given.isdecimal() or not 1 <= int(given) <= _MOST_WORKERS:
        raise UsageError(f"--workers {given}: give a number from 1 to {_MOST_WORKERS}, or auto")
    return int(given)


def simulation_options(
    rate_factor: float, noise: bool, command_lag_s: float, odometry_rate_hz: float | None, pretend_real: bool
) -> "SimulationOptions":
    """Return how the robot is played, of what was typed."""
    from vsnbench.simulator.noise import NoiseSettings
    from vsnbench.simulator.robot_player import SimulationOptions

    kind_of_noise = NoiseSettings() if noise else None
    return SimulationOptions(rate_factor, kind_of_noise, command_lag_s, odometry_rate_hz, pretend_real)
