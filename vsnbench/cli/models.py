"""`vsnbench models`: which models there are, beginning one, what is in a checkpoint, and fetching one."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from vsnbench.cli.episode_page import safe
from vsnbench.cli.listing import name_column, print_list, prose_column
from vsnbench.cli.model_serving import check_against_contract, check_served, serve
from vsnbench.cli.output import Json, print_files, print_json

if TYPE_CHECKING:
    from vsnbench.models.description import ModelCheck, ModelDescription

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

ModelName = Annotated[str, typer.Argument(help="A model's name, or package.module:Class.", metavar="MODEL")]


@app.command()
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


app.command("serve")(serve)


@app.command("list")
def list_models(as_json: Json = False) -> None:
    """List the models: built-in ones and installed plug-ins.

    [bold]Examples[/bold]

        vsnbench models list
        vsnbench models list --json
    """
    from vsnbench.errors import ModelError
    from vsnbench.models.description import describe_model
    from vsnbench.models.registry import known_models

    described, broken = [], []
    for name in known_models():
        try:
            described.append(describe_model(name))
        except ModelError as error:
            broken.append({"name": name, "error": str(error)})
    if as_json:
        print_json([_description_json(model) for model in described] + broken)
        return
    columns = (
        name_column("model"),
        prose_column("what it is"),
        prose_column("goals", rank=1),
        prose_column("weights"),
    )
    rows = [(safe(model.name), safe(model.summary), safe(_goals(model)), _weights_state(model)) for model in described]
    print_list(
        columns, [*rows, *((safe(each["name"]), f"[red]{safe(each['error'])}[/red]", "", "") for each in broken)]
    )


@app.command()
def show(name: ModelName, as_json: Json = False) -> None:
    """Show one model: goals, sensors, options, settings, and where its weights are looked for.

    [bold]Examples[/bold]

        vsnbench models show pirlnav
        vsnbench models show mylab.policy:Policy --json
    """
    from vsnbench.models.description import describe_model

    model = describe_model(name)
    if as_json:
        print_json(_description_json(model))
        return
    console = Console()
    console.print(f"[bold]{model.name}[/bold]: {model.summary}\n", highlight=False)
    grid = Table.grid(padding=(0, 2))
    grid.add_row("class", model.where)
    grid.add_row("goals", _goals(model))
    if model.sensors:
        grid.add_row("sensors", ", ".join(model.sensors))
    flags, others = _keywords(model)
    grid.add_row("options", ", ".join(flags) or "none")
    if others:
        grid.add_row("in Python", f"{model.where.partition(':')[2]}({', '.join(others)})")
    grid.add_row("weights", _weights_state(model))
    if model.weights_file:
        from vsnbench.models.weights import weights_directory

        grid.add_row("", f"looked for at {weights_directory() / model.weights_file}")
    console.print(grid, highlight=False, soft_wrap=True)
    if model.settings_class is not None:
        console.print("\n[bold]Settings[/bold] (a YAML file, given as --model-config)", highlight=False)
        table = Table(box=None, pad_edge=False, header_style="bold")
        for heading in ("setting", "default", "meaning"):
            table.add_column(heading, overflow="fold")
        for field, default, meaning in _settings_of(model):
            table.add_row(field, default, meaning)
        console.print(table, highlight=False)


@app.command()
def check(
    name: ModelName,
    weights: Annotated[
        Path | None,
        typer.Option("--weights", "-w", help="The checkpoint, or 'embedded'; else $VSNBENCH_WEIGHTS is searched."),
    ] = None,
    model_config: Annotated[Path | None, typer.Option("--model-config", help="YAML of the model's settings.")] = None,
    device: Annotated[str, typer.Option("--device", help="auto, cpu, cuda or mps.")] = "auto",
    as_json: Json = False,
) -> None:
    """Try a model: its weights against plain PyTorch, a class of your own or a server against the contract.

    Weights are read without running anything in them; a file that is damaged or hostile is refused.
    A class is tried against docs/models.md (one seed, one answer; episodes that forget the last; sensors that are
    read; odd images; time), a server against docs/wire.md. Exit code 1 when something fails.

    [bold]Examples[/bold]

        vsnbench models check mylab.policy:MyModel
        vsnbench models check pirlnav --weights objectnav_rl_ft_hd.ckpt
        vsnbench models check pirlnav --device cpu --json
        vsnbench models check ws://127.0.0.1:8765
    """
    from vsnbench.models.description import describe_model
    from vsnbench.models.registry import locate

    if name.startswith(("ws://", "wss://")):
        check_served(name, model_config, as_json=as_json)
        return
    if not describe_model(name).can_check:
        given = {"weights": weights, "model_config": model_config, "device": None if device == "auto" else device}
        options = {option: value for option, value in given.items() if value is not None}
        check_against_contract(name, options, as_json=as_json)
        return
    _, factory = locate(name)
    report: ModelCheck = factory.check(weights=weights, model_config=model_config, device=device)
    if as_json:
        print_json(_check_json(report))
    else:
        _print_check(report)


@app.command()
def fetch(
    name: ModelName,
    url: Annotated[str, typer.Argument(help="Where the weights lie.", metavar="URL")],
    sha256: Annotated[str, typer.Option("--sha256", help="The hash they must have.", metavar="HASH")],
    as_json: Json = False,
) -> None:
    """Download weights into the directory of weights; goes on where it stopped, keeps only what has the hash.

    Known links are listed in docs/pirlnav.md. The directory is $VSNBENCH_WEIGHTS, else ~/.local/share/vsnbench/weights.

    [bold]Example[/bold]

        vsnbench models fetch pirlnav https://example.org/il.ckpt --sha256 5d1c...
    """
    from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

    from vsnbench.errors import UsageError
    from vsnbench.models.description import describe_model
    from vsnbench.models.fetching import fetch as download
    from vsnbench.models.weights import weights_directory

    model = describe_model(name)
    if not model.weights_file:
        raise UsageError(f"model {name} has no weights to fetch")
    destination = weights_directory() / model.weights_file
    console = Console(stderr=True)
    columns = ("{task.description}", BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    task = bar.add_task(model.weights_file, total=None)

    def progress(here_bytes: int, whole_bytes: int | None) -> None:
        bar.start()
        bar.update(task, completed=here_bytes, total=whole_bytes)

    try:
        fresh = download(url, destination, sha256, progress)
    finally:
        bar.stop()
    if as_json:
        print_files([destination], as_json=True, fetched=fresh, sha256=sha256)
        return
    typer.echo(f"{destination}" if fresh else f"{destination} (was already there)")
    if model.can_check:
        typer.echo(f"next: vsnbench models check {name}", err=True)


def _goals(model: "ModelDescription") -> str:
    return "any" if model.goals is None else ", ".join(model.goals)


def _keywords(model: "ModelDescription") -> tuple[list[str], list[str]]:
    """Return the constructor's keywords that are options of `vsnbench run`, and the others with their defaults."""
    from vsnbench.models.registry import FLAGS

    flags = [f"--{name.replace('_', '-')}" for name in model.keywords if name in FLAGS]
    others = [f"{name}={value}" if value else name for name, value in model.keywords.items() if name not in FLAGS]
    return flags, others


def _weights_state(model: "ModelDescription") -> str:
    from vsnbench.models.weights import embedded_weights, weights_directory

    if not model.weights_file:
        return "needs none"
    if (weights_directory() / model.weights_file).is_file():
        return "[green]found[/green]"
    if embedded_weights(model.weights_file) is not None:
        return "[green]embedded[/green], for demonstration"
    return "[yellow]not here[/yellow]"


def _settings_of(model: "ModelDescription") -> list[tuple[str, str, str]]:
    if model.settings_class is None:
        return []
    rows = []
    for field, info in model.settings_class.model_fields.items():
        default = getattr(info.default, "value", info.default)
        shown = {None: "not set", True: "true", False: "false"}.get(default, str(default))
        rows.append((field, shown, info.description or ""))
    return rows


def _description_json(model: "ModelDescription") -> dict[str, Any]:
    return {
        "name": model.name,
        "class": model.where,
        "summary": model.summary,
        "goals": None if model.goals is None else list(model.goals),
        "sensors": [sensor.value for sensor in model.sensors],
        "options": _keywords(model)[0],
        "keywords": dict(model.keywords),
        "weights_file": model.weights_file or None,
        "settings": {name: default for name, default, _ in _settings_of(model)},
    }


def _check_json(report: "ModelCheck") -> dict[str, Any]:
    return {
        "model": report.model,
        "weights": str(report.weights),
        "sha256": report.sha256,
        "size_bytes": report.size_bytes,
        **report.facts,
        "engine": report.chosen_engine,
        "parity": None if report.parity is None else dict(report.parity),
        "timings": [{"engine": t.engine, "median_ms": round(t.median_ms, 3), "steps": t.steps} for t in report.timings],
        "warning": report.warning or None,
    }


def _print_check(report: "ModelCheck") -> None:
    console = Console()
    console.print(f"[bold]{report.weights}[/bold]", highlight=False, soft_wrap=True)
    grid = Table.grid(padding=(0, 2))
    grid.add_row("sha256", report.sha256)
    grid.add_row("size", f"{report.size_bytes / 1e6:.1f} MB")
    for fact, value in report.facts.items():
        grid.add_row(fact.replace("_", " "), _fact_text(value))
    grid.add_row("runs on", report.chosen_engine)
    grid.add_row("parity", _parity_text(report))
    for timing in report.timings:
        grid.add_row("time", f"{timing.median_ms:.1f} ms a step, median of {timing.steps}: {timing.engine}")
    if len(report.timings) == 2:
        reference, chosen = report.timings
        grid.add_row("", f"{reference.median_ms / chosen.median_ms:.2f} times as fast as the reference")
    console.print(grid, highlight=False, soft_wrap=True)


def _fact_text(value: str | int | float | bool | None) -> str:  # noqa: PYI041 - each is meant
    if value is None:
        return "not said"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _parity_text(report: "ModelCheck") -> str:
    if report.parity is None:
        return "this is the reference itself" + (f": {report.warning}" if report.warning else "")
    return (
        f"[green]agrees[/green] with PyTorch on the CPU: logits within {report.parity['largest_logit_difference']:.1e} "
        f"(allowed {report.parity['tolerance']:.1e}), same actions, {report.parity['steps']} steps"
    )
