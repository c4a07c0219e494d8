"""`vsnbench models new`: a package to begin a model of one's own with."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.output import Json, print_files


def new(
    directory: Annotated[Path, typer.Argument(help="A new directory; its name becomes the model's.", metavar="DIR")],
    as_json: Json = False,
) -> None:
    """Write a package with a model that drives, its settings, its tests and a README: change it into yours.

    [bold]Example[/bold]

        vsnbench models new mine
        cd mine
        vsnbench run --model mine.policy:Mine --goal chair --starts 1 --watch
    """
    from vsnbench.models.starting import write_model_package

    model, files = write_model_package(directory)
    print_files(files, as_json=as_json, model=model)
    typer.echo(f"next: cd {shlex.quote(str(directory))} && vsnbench models check {model}", err=True)
    typer.echo(f"      vsnbench run --model {model} --goal chair --starts 1 --watch", err=True)
