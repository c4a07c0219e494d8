"""`vsnbench models fetch`: download weights by name or address."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.output import Json, print_files
from vsnbench.errors import ModelError, UsageError
from vsnbench.text.terminal import Console

if TYPE_CHECKING:
    from vsnbench.models.checkpoints.published import PublishedFile


def fetch(
    name: Annotated[
        str,
        typer.Argument(help="Weights: mask-rcnn, vlv-value, pirlnav-il, pirlnav-rl, or a model.", metavar="NAME"),
    ],
    url: Annotated[
        str | None,
        typer.Argument(help="Address of the file. Default: where its authors published it.", metavar="URL"),
    ] = None,
    sha256: Annotated[
        str | None,
        typer.Option("--sha256", help="Expected SHA-256 of the file. Default: the published one.", metavar="HASH"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Download weights, resume an interrupted download, and verify the hash, or the content if none is published.

    The directory is $VSNBENCH_WEIGHTS, else ~/.local/share/vsnbench/weights.

    [bold]Examples[/bold]

        vsnbench models fetch mask-rcnn
        vsnbench models fetch pirlnav-rl
        vsnbench models fetch pirlnav https://example.org/il.ckpt --sha256 5d1c...
    """
    from vsnbench.models.checkpoints.weights import file_sha256

    destination, licence, next_command, fetched = _download(name, url, sha256)
    found = file_sha256(destination)
    if as_json:
        print_files([destination], as_json=True, fetched=fetched, sha256=found, licence=licence or None)
        return
    typer.echo(f"{destination}" if fetched else f"{destination} (already downloaded)")
    typer.echo(f"sha256: {found}", err=True)
    if licence:
        typer.echo(f"licence: {licence}", err=True)
    typer.echo(f"next: {next_command}", err=True)


def _download(name: str, url: str | None, sha256: str | None) -> tuple[Path, str, str, bool]:
    """Download a file. Returns its path, its licence, the next command, and whether it is new."""
    from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

    from vsnbench.models.checkpoints.fetching import fetch as download
    from vsnbench.models.checkpoints.published import PUBLISHED, PublishedFile
    from vsnbench.models.checkpoints.weights import weights_directory
    from vsnbench.models.description import describe_model

    file = PUBLISHED.get(name) or PublishedFile(name, describe_model(name).weights_file, url="", licence="")
    if not file.file_name:
        raise UsageError(f"model {name} has no weights to fetch")
    address, known = url or file.url, sha256 or file.sha256
    if not address:
        named = [key for key, other in PUBLISHED.items() if (other.model, other.file_name) == (name, file.file_name)]
        advice = f"fetch {' or '.join(named)}, or give URL" if named else "give URL"
        raise UsageError(f"no address is published for {name}", advice=advice, code="address-missing")
    check_content = None if known else _reader(name, file)
    if not known and check_content is None:
        raise UsageError(
            f"no hash is published for {name}",
            advice="give --sha256 HASH, from `sha256sum` of a copy that you trust",
            code="hash-missing",
        )
    destination = weights_directory() / file.file_name
    console = Console(stderr=True)
    columns = ("{task.description}", BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    task = bar.add_task(file.file_name, total=None)

    def progress(received_bytes: int, total_bytes: int | None) -> None:
        bar.start()
        bar.update(task, completed=received_bytes, total=total_bytes)

    try:
        digits = 64 if sha256 else len(known)
        fetched = download(address, destination, known, progress, known_digits=digits, check_content=check_content)
    except ModelError as error:
        if error.code != "download-failed" or not file.page:
            raise
        raise ModelError(
            error.statement,
            advice=f"get the file from its authors ({file.page}), put it at {destination} or name it with --weights, "
            f"and check it: vsnbench models check {file.model}",
            code=error.code,
        ) from error
    finally:
        bar.stop()
    if not known:
        typer.echo(f"no hash is published for {name}: checked by its content only", err=True)
    is_checked = file.file_name == describe_model(file.model).weights_file
    next_command = f"models check {file.model}" if is_checked else f"run --model {file.model} --starts 1"
    return destination, file.licence, f"vsnbench {next_command}", fetched


def _reader(name: str, file: "PublishedFile") -> Callable[[Path], object] | None:
    """Return a function that reads the weights and refuses another file; None if there is none for them."""
    from vsnbench.models.checkpoints.published import PUBLISHED

    if file.model == "pirlnav":
        from vsnbench.models.pirlnav.checkpoint import read_checkpoint, read_published

        return read_checkpoint if name == "pirlnav" else partial(read_published, fine_tuned=name == "pirlnav-rl")
    if file.file_name == PUBLISHED["vlv-value"].file_name:
        from vsnbench.models.checkpoints.torch_runtime import require_torch

        require_torch()  # before the download, which could not be checked
        from vsnbench.models.vlv.value.weights import read_value_weights

        return read_value_weights
    return None
