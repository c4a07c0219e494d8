"""`vsnbench bundle`: results in one file that another person can check."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.lists import split_numbers
from vsnbench.cli.support.options import Campaigns, Database, Results, results_directory
from vsnbench.cli.support.output import Json, print_json
from vsnbench.errors import UsageError
from vsnbench.text.sanitize import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    from sqlalchemy import Connection

    from vsnbench.evidence.bundle.selection import BundleSelection
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.study.lock import LockNote

_IMAGES = "images"


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    file: Annotated[Path, typer.Argument(help="Path of a new file, like results.zip.")],
    study: Annotated[
        str, typer.Option("--study", metavar="FILE|N", help="The study of this file, or with this number.")
    ] = "",
    campaign: Campaigns = None,
    without: Annotated[
        str, typer.Option("--without", metavar="images", help="Leave the images out: rows, tables and report only.")
    ] = "",
    with_weights: Annotated[
        bool, typer.Option("--with-weights", help="Add the models' weights; otherwise only their hashes.")
    ] = False,
    with_scan: Annotated[
        bool, typer.Option("--with-scan", help="Add the scans of the sites; otherwise only their hashes.")
    ] = False,
    key: Annotated[
        Path | None, typer.Option("--sign", metavar="KEY", help="Sign with this SSH key, as `ssh-keygen` makes it.")
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Pack a study or campaigns into one file that another person can check with `vsnbench verify`.

    It has the rows with their UUIDs, images, site, robot, models, plan, commands, packages, tables and report, and a
    hash of every file. The same record gives the same bytes. The section `bundle` of vsnbench.toml has `author`,
    `licence` and `citation`.

    [bold]Examples[/bold]

        vsnbench bundle --study study.yaml study.zip
        vsnbench bundle --campaign 1,3 results.zip
        vsnbench bundle --campaign 1 --without images numbers.zip
        vsnbench bundle --study 1 --sign ~/.ssh/id_ed25519 study.zip
    """
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.config import load_config
    from vsnbench.evidence.bundle.make import BundleRequest, make_bundle

    if without not in ("", _IMAGES):
        raise UsageError(f"--without {without}: unknown value", advice=f"give {_IMAGES}", code="unknown-value")
    numbers = split_numbers(campaign, "--campaign", "1,3-5")
    if bool(study) == bool(numbers):
        raise UsageError("give either --study or --campaign", advice="`vsnbench db status` lists the campaigns")
    place = results_directory(results, db)
    select, note = _selection(study, numbers, place)
    request = BundleRequest(select, load_config().bundle, note, not without, with_weights, with_scan, key)
    with ProgressBars() as progress:
        done = make_bundle(place, request, file, progress.show)
    if as_json:
        print_json(asdict(done))
        return
    typer.echo(str(file))
    content = f"{counted(done.episodes, 'episode')}, {counted(done.files, 'file')}, {done.size_bytes / 1e6:.1f} MB"
    typer.echo(f"{content}, manifest {done.manifest_sha256[:16]}{', signed' if done.signed else ''}", err=True)
    typer.echo(f"next: vsnbench verify {shlex.quote(str(file))}", err=True)


def _selection(
    study: str, campaigns: tuple[int, ...], place: "ResultsDirectory"
) -> "tuple[Callable[[Connection], BundleSelection], LockNote | None]":
    """Return what selects the rows, and the lock note of a study that is given by its file."""
    from vsnbench.cli.study.file import open_study
    from vsnbench.evidence.bundle.selection import select_campaigns, select_study
    from vsnbench.study.lock import read_note

    if not study:
        return lambda record: select_campaigns(record, campaigns), None
    if study.isdecimal():
        return lambda record: select_study(record, int(study)), None
    number = open_study(Path(study), place.path, place.database_url).recorded.id
    return lambda record: select_study(record, number), read_note(Path(study))
