"""`vsnbench models serve` and what `models check` tries of a model: behind a WebSocket, or in this process."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.output import print_json
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.models.contract_check import ContractFinding

_WHERE = "Where"


def serve(
    model: Annotated[
        str | None, typer.Argument(help="A model's name, or package.module:Class.", metavar="[MODEL]")
    ] = None,
    host: Annotated[
        str,
        typer.Option(
            "--host", help="address to listen on; another than loopback needs a token", rich_help_panel=_WHERE
        ),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0: a free one", rich_help_panel=_WHERE)] = 8765,
    unix_path: Annotated[
        Path | None, typer.Option("--unix-path", help="a socket file in place of host and port", rich_help_panel=_WHERE)
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option("--certificate", help="PEM file: serve wss://", rich_help_panel=_WHERE)
    ] = None,
    key: Annotated[Path | None, typer.Option("--key", help="PEM file of its key", rich_help_panel=_WHERE)] = None,
    weights: Annotated[Path | None, typer.Option("--weights", "-w", help="The checkpoint, or 'embedded'.")] = None,
    model_config: Annotated[Path | None, typer.Option("--model-config", help="YAML of the model's settings.")] = None,
    device: Annotated[str | None, typer.Option("--device", help="auto, cpu, cuda or mps.")] = None,
    write_stub: Annotated[
        Path | None,
        typer.Option(
            "--write-stub", metavar="DIR", help="write vsnbench_policy.py there, to serve a model without vsnbench"
        ),
    ] = None,
) -> None:
    """Serve a model over the network: the robot's machine runs `vsnbench run --model ws://HOST:PORT`.

    [bold]Examples[/bold]

        vsnbench models serve pirlnav --port 8765
        VSNBENCH_TOKEN=secret vsnbench models serve pirlnav --host 0.0.0.0
        vsnbench models serve --write-stub ~/mymodel

    A model in another Python is served by the one file that the last example writes:
    docs/models.md and docs/wire.md say how.
    """
    if (model is None) == (write_stub is None):
        raise UsageError("name the model to serve, or a directory with --write-stub")
    if write_stub is not None:
        _write_stub(write_stub)
        return
    from vsnbench.models.registry import create_policy
    from vsnbench.models.remote.serving import ServedPolicy
    from vsnbench.models.remote.vsnbench_policy import serve as serve_policy

    given = {"weights": weights, "model_config": model_config, "device": device}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    policy = create_policy(str(model), None, **options)
    try:
        serve_policy(
            ServedPolicy(policy, str(model), options),
            host=host,
            port=port,
            certificate=str(certificate) if certificate else None,
            key=str(key) if key else None,
            unix_path=str(unix_path) if unix_path else None,
        )
    except (OSError, ValueError) as error:
        raise UsageError(f"cannot serve {model} at {unix_path or f'{host}:{port}'}: {error}") from error


def check_served(url: str, model_config: Path | None, *, as_json: bool) -> None:
    """Try a model's server and say what was seen; exit code 1 when something fails."""
    from vsnbench.models.remote.checking import check_server

    tell_of_contract(check_server(url, model_config), as_json=as_json)


def check_against_contract(name: str, options: dict[str, Any], *, as_json: bool) -> None:
    """Try a policy in this process and say what was seen; exit code 1 when something fails."""
    from vsnbench.models.contract import SurveyedPolicy
    from vsnbench.models.contract_check import check_policy
    from vsnbench.models.registry import create_policy

    policy = create_policy(name, None, **options)
    try:
        if isinstance(policy, SurveyedPolicy):
            raise UsageError(
                f"model {name} is handed the site, and made-up looks belong to none",
                advice=f"try it in one: vsnbench run --model {name} --goal chair --starts 1",
            )
        findings = check_policy(policy)
    finally:
        if callable(close := getattr(policy, "close", None)):
            close()
    tell_of_contract(findings, as_json=as_json)


def tell_of_contract(findings: "Sequence[ContractFinding]", *, as_json: bool) -> None:
    """Print what was tried of a model; exit code 1 when something failed."""
    from dataclasses import asdict

    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from vsnbench.harmless_text import harmless

    if as_json:
        print_json([asdict(finding) for finding in findings])
    else:
        grid = Table.grid(padding=(0, 2))
        for finding in findings:
            mark = "[green]ok[/green]" if finding.passed else "[red]failed[/red]"
            grid.add_row(mark, finding.what, escape(harmless(finding.seen)))
        Console().print(grid, highlight=False)
    if not all(finding.passed for finding in findings):
        raise typer.Exit(1)


def _write_stub(directory: Path) -> None:
    from vsnbench.errors import UsageError
    from vsnbench.models.remote import vsnbench_policy

    source = Path(vsnbench_policy.__file__)
    target = directory.expanduser() / source.name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.read_bytes())
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    typer.echo(f"{target}\nserve a model there:  python {source.name} mymodel:Class --port 8765")
