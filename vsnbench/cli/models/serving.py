"""`vsnbench models serve`, and the checks of `models check` for classes and servers."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.support.options import options_under
from vsnbench.cli.support.output import print_json, without_prints_of_models
from vsnbench.errors import UsageError
from vsnbench.files.home import expanded
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from vsnbench.models.contract_check import ContractFinding
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.values.robot_profile import RobotProfile

_address_option = options_under("Address")

_WIDEST_CHECK = len("episodes are independent")
"""Width of the column with the names of checks, which are printed before the last name is known."""


def serve(  # noqa: PLR0913 - Typer needs a parameter per option
    model: Annotated[
        str | None, typer.Argument(help="Name of a model, or package.module:Class.", metavar="MODEL")
    ] = None,
    host: Annotated[
        str, _address_option("--host", help="Address to listen on; others than loopback need $VSNBENCH_TOKEN.")
    ] = "127.0.0.1",
    port: Annotated[int, _address_option("--port", min=0, max=65535, help="Port; 0 for any free port.")] = 8765,
    unix_path: Annotated[
        Path | None, _address_option("--unix-path", help="Socket file instead of host and port.")
    ] = None,
    certificate: Annotated[Path | None, _address_option("--certificate", help="PEM file for wss://.")] = None,
    key: Annotated[Path | None, _address_option("--key", help="PEM file of the certificate's private key.")] = None,
    weights: Annotated[Path | None, typer.Option("--weights", "-w", help="File of the weights, or 'embedded'.")] = None,
    model_config: Annotated[
        Path | None, typer.Option("--model-config", help="YAML file of the model's settings.")
    ] = None,
    device: Annotated[str | None, typer.Option("--device", help="Device: auto, cpu, cuda or mps.")] = None,
    sessions: Annotated[
        int, typer.Option("--sessions", min=1, max=256, help="Number of clients at a time, for run --workers.")
    ] = 1,
    batch: Annotated[
        int,
        typer.Option("--batch", min=1, help="Observations that a model may answer together; over 1, last bits differ."),
    ] = 1,
    write_stub: Annotated[
        Path | None,
        typer.Option(
            "--write-stub", metavar="DIR", help="Write vsnbench_policy.py, which serves a model without vsnbench."
        ),
    ] = None,
) -> None:
    """Serve a model over the network; the client runs `vsnbench run --model ws://HOST:PORT`.

    [bold]Examples[/bold]

        vsnbench models serve pirlnav --port 8765
        VSNBENCH_TOKEN=secret vsnbench models serve pirlnav --host 0.0.0.0
        vsnbench models serve pirlnav --sessions 8 --batch 8
        vsnbench models serve --write-stub ~/mymodel

    The file of the last example serves a model in an environment without vsnbench
    (docs/models.md, docs/wire.md).
    """
    if (model is None) == (write_stub is None):
        raise UsageError("give either a model to serve, or a directory with --write-stub")
    if write_stub is not None:
        _write_stub(write_stub)
        return
    from vsnbench.models.names import require_no_person

    require_no_person(str(model), "models serve")
    from vsnbench.models.process_exit import process_exit_refused
    from vsnbench.models.registry import create_policy
    from vsnbench.models.remote.serving import served
    from vsnbench.models.remote.vsnbench_policy import serve as serve_policy

    values = {"weights": weights, "model_config": model_config, "device": device}
    options: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    try:
        with process_exit_refused():
            serve_policy(
                lambda: served(create_policy(str(model), None, **options), str(model), options, sessions),
                host=host,
                port=port,
                certificate=str(certificate) if certificate else None,
                key=str(key) if key else None,
                unix_path=str(unix_path) if unix_path else None,
                sessions=sessions,
                batch=batch,
            )
    except (OSError, ValueError) as error:
        raise UsageError(f"cannot serve {model} at {unix_path or f'{host}:{port}'}: {error}") from error


def check_against_contract(
    name: str, options: dict[str, Any], parameters: "ProtocolParameters", profile: "RobotProfile | None"
) -> "Iterator[ContractFinding]":
    """Check a policy in this process, and yield each result as it is known."""
    from vsnbench.models.contract_check import check_policy
    from vsnbench.runner.setup.trial_setup import warn_of_assumptions
    from vsnbench.runner.setup.trying import opened_policy

    with opened_policy(name, options) as policy:
        if policy.needs_survey:
            raise UsageError(
                f"model {name} receives the site, and the images of this check belong to no site",
                advice=f"run it in a site: vsnbench run --model {name} --goal chair --starts 1",
            )
        warn_of_assumptions(policy.card, parameters)
        yield from check_policy(policy, profile)


def print_findings(findings: "Iterator[ContractFinding]", *, as_json: bool) -> None:
    """Run checks and print each result as it is known, as JSON all at the end; exit code 1 if a check failed."""
    found: list[ContractFinding] = []
    while True:
        with without_prints_of_models(as_json=as_json):  # the model runs here
            finding = next(findings, None)
        if finding is None:
            break
        found.append(finding)
        if not as_json:
            _print_finding(finding)
    if as_json:
        print_json([asdict(finding) for finding in found])
    if not all(finding.passed for finding in found):
        raise typer.Exit(1)


def _print_finding(finding: "ContractFinding") -> None:
    from rich.markup import escape
    from rich.table import Table

    from vsnbench.text.terminal import Console

    grid = Table.grid(padding=(0, 2))
    grid.add_column(min_width=len("failed"))
    grid.add_column(min_width=_WIDEST_CHECK)
    grid.add_column()
    result = "[green]ok[/green]" if finding.passed else "[red]failed[/red]"
    grid.add_row(result, finding.what, escape(sanitize(finding.seen)))
    Console().print(grid, highlight=False)


def _write_stub(directory: Path) -> None:
    from vsnbench.models.remote import vsnbench_policy

    source = Path(vsnbench_policy.__file__)
    target = expanded(directory) / source.name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.read_bytes())
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    typer.echo(f"{target}\nserve a model:  python {source.name} mymodel:Class --port 8765")
