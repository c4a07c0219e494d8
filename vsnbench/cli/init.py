"""`vsnbench init`: create a working directory."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.support.output import Json, print_json
from vsnbench.errors import UsageError
from vsnbench.files.home import expanded

_STARTER = Path(__file__).with_name("starter")
_FILES = {"vsnbench.toml": "vsnbench.toml", "lab.yaml": "lab.yaml", "gitignore": ".gitignore"}


def command(
    directory: Annotated[
        Path, typer.Argument(help="Directory, created if necessary.", metavar="DIR", show_default=False)
    ] = Path(),
    as_json: Json = False,
) -> None:
    """Create a directory with a configuration (vsnbench.toml), a site to edit and a .gitignore.

    Existing files are not changed.

    [bold]Examples[/bold]

        vsnbench init
        vsnbench init ~/benchmark
    """
    target = expanded(directory)
    made, kept = [], []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for source, name in _FILES.items():
            file = target / name
            try:
                with file.open("x", encoding="utf-8") as new:
                    new.write((_STARTER / source).read_text(encoding="utf-8"))
            except FileExistsError:
                kept.append(file)
            else:
                made.append(file)
    except OSError as error:
        raise UsageError(f"cannot write {target}: {error.strerror}") from error
    if as_json:
        print_json({"files": list(map(str, made)), "kept": list(map(str, kept))})
        return
    for file in made:
        typer.echo(file)
    for file in kept:
        typer.echo(f"{file} (exists, not changed)")
    change_directory = "" if target.resolve() == Path.cwd() else f"cd {shlex.quote(str(target))} && "
    typer.echo(f"next: {change_directory}vsnbench sites check lab.yaml", err=True)
    typer.echo("      vsnbench run --model oracle --goal all", err=True)
    typer.echo("      vsnbench report", err=True)
