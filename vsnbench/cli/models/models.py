"""`vsnbench models`: create, list, show, check, serve and fetch models."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from vsnbench.cli.models.cards import UNKNOWN, card_json, card_rows
from vsnbench.cli.models.fetching import fetch
from vsnbench.cli.models.serving import check_against_contract, print_findings, serve
from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.cli.support.options import Protocol, configured_option
from vsnbench.cli.support.output import Json, print_files, print_json, without_prints_of_models
from vsnbench.cli.support.terminal import safe
from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_ROBOT
from vsnbench.errors import ModelError, UsageError
from vsnbench.text.terminal import Console

if TYPE_CHECKING:
    from vsnbench.models.contract import ModelCard, ModelCheck
    from vsnbench.models.description import ModelDescription
    from vsnbench.values.robot_profile import RobotProfile

app = typer.Typer(no_args_is_help=True)

ModelName = Annotated[
    str, typer.Argument(help="Name of a model, package.module:Class, or stack:FILE.yaml.", metavar="MODEL")
]


@app.command()
def new(
    directory: Annotated[
        Path, typer.Argument(help="New directory; its name becomes the name of the model.", metavar="DIR")
    ],
    stack: Annotated[
        bool, typer.Option("--stack", help="Write the commented file DIR.yaml of a stack that drives itself instead.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Create a package with a working model, its settings, tests and README; or the file of a stack.

    [bold]Examples[/bold]

        vsnbench models new mine
        cd mine
        vsnbench run --model mine.policy:Mine --goal chair --starts 1 --watch

        vsnbench models new --stack theirs
        vsnbench models show stack:theirs.yaml
    """
    from vsnbench.models.starting import write_model_package, write_stack_file

    if stack:
        file = write_stack_file(directory)
        model = f"stack:{file}"
        print_files([file], as_json=as_json, model=model)
        typer.echo(f"next: edit {shlex.quote(str(file))}, then vsnbench models show {shlex.quote(model)}", err=True)
        return
    model, files = write_model_package(directory)
    print_files(files, as_json=as_json, model=model)
    typer.echo(f"next: cd {shlex.quote(str(directory))} && vsnbench models check {model}", err=True)
    typer.echo(f"      vsnbench run --model {model} --goal chair --starts 1 --watch", err=True)


app.command("serve")(serve)


@app.command("list")
def list_models(as_json: Json = False) -> None:
    """List built-in models and installed plug-ins.

    [bold]Examples[/bold]

        vsnbench models list
        vsnbench models list --json
    """
    from vsnbench.models.description import describe_model
    from vsnbench.models.names import known_models

    described, broken = [], []
    for name in known_models():
        try:
            with without_prints_of_models(as_json=as_json):
                described.append(describe_model(name))
        except ModelError as error:
            broken.append({"name": name, "error": str(error)})
    if as_json:
        print_json([_description_json(model) for model in described] + broken)
        return
    columns = (
        name_column("model"),
        prose_column("description"),
        prose_column("goals", rank=1),
        prose_column("weights"),
    )
    rows = [(safe(model.name), safe(model.summary), safe(_goals(model)), _weights_state(model)) for model in described]
    print_list(
        columns, [*rows, *((safe(model["name"]), f"[red]{safe(model['error'])}[/red]", "", "") for model in broken)]
    )


@app.command()
def show(name: ModelName, as_json: Json = False) -> None:
    """Show a model: goals, sensors, options, settings and the location of its weights.

    [bold]Examples[/bold]

        vsnbench models show pirlnav
        vsnbench models show mylab.policy:Policy --json
        vsnbench models show stack:theirs.yaml
    """
    from vsnbench.models.description import describe_model
    from vsnbench.models.names import is_stack

    with without_prints_of_models(as_json=as_json):
        model = describe_model(name)
    if as_json:
        print_json(_description_json(model))
        return
    console = Console()
    console.print(f"[bold]{escape(model.name)}[/bold]: {escape(model.summary)}\n", highlight=False)
    is_file = is_stack(name)
    rows = [("file" if is_file else "class", model.where), ("goals", _goals(model)), *card_rows(model.card)]
    if sensors := _sensors(model):
        rows.append(("sensors", ", ".join(sensors)))
    flags, others = _keywords(model)
    rows.append(("options", ", ".join(flags) or "none"))
    if others:
        rows.append(("in Python", f"{model.where.partition(':')[2]}({', '.join(others)})"))
    rows = [*((name, escape(value)) for name, value in rows), ("weights", _weights_state(model))]
    if model.weights_file:
        from vsnbench.models.checkpoints.weights import weights_directory

        rows.append(("", f"searched at {escape(str(weights_directory() / model.weights_file))}"))
    _print_rows(console, rows)
    if model.settings_class is not None:
        console.print("\n[bold]Settings[/bold] (YAML file of --model-config)", highlight=False)
        table = Table(box=None, pad_edge=False, header_style="bold")
        for heading in ("setting", "default", "meaning"):
            table.add_column(heading, overflow="fold")
        for row in _settings_of(model):
            table.add_row(*map(escape, row))
        console.print(table, highlight=False)


@app.command()
def check(
    name: ModelName,
    weights: Annotated[
        Path | None,
        typer.Option("--weights", "-w", help="File of the weights, or 'embedded'. Default: $VSNBENCH_WEIGHTS."),
    ] = None,
    model_config: Annotated[
        Path | None, typer.Option("--model-config", help="YAML file of the model's settings.")
    ] = None,
    device: Annotated[str, typer.Option("--device", help="Device: auto, cpu, cuda or mps.")] = "auto",
    protocol: Protocol = BUILT_IN_PROTOCOL,
    robot: Annotated[
        str,
        configured_option(
            "robot", "-r", help="Robot whose camera is compared with the one that the model was trained with."
        ),
    ] = BUILT_IN_ROBOT,
    as_json: Json = False,
) -> None:
    """Check a model: the weights of a built-in model, or the behaviour of a class or server.

    Weights are compared with plain PyTorch. No code in the file runs; damaged or hostile files are refused.
    Classes and servers must accept every kind of goal on their card, give only decisions that `run` executes, be
    deterministic for a seed, independent of earlier episodes, and accept unusual images (docs/models.md, docs/wire.md).
    Exit code 1 if a check fails.
    A model whose card assumes other step sizes than the protocol's, or another camera than the robot's, gets a warning.

    [bold]Examples[/bold]

        vsnbench models check mylab.policy:MyModel
        vsnbench models check pirlnav --weights objectnav_rl_ft_hd.ckpt
        vsnbench models check pirlnav --device cpu --json
        vsnbench models check ws://127.0.0.1:8765
        vsnbench models check vlv --robot turtlebot4
    """
    from vsnbench.models.description import describe_model
    from vsnbench.models.fit.camera import camera_differences
    from vsnbench.models.names import is_address, is_stack, require_no_person
    from vsnbench.models.registry import locate
    from vsnbench.protocol.named import load_protocol
    from vsnbench.robots.registry import profile_of
    from vsnbench.runner.setup.trial_setup import warn_of_assumptions

    require_no_person(name, "models check")
    parameters, profile = load_protocol(protocol), profile_of(robot)
    if is_address(name):
        from vsnbench.models.remote.checking import check_server

        print_findings(check_server(name, model_config, parameters, profile), as_json=as_json)
        return
    if is_stack(name):
        raise UsageError(
            f"{name} is not asked for decisions, so there is nothing to check",
            advice=f"check its file with vsnbench models show {name}",
            code="stack-not-watched",
        )
    with without_prints_of_models(as_json=as_json):
        can_check = describe_model(name).can_check
    if not can_check:
        given = {"weights": weights, "model_config": model_config, "device": None if device == "auto" else device}
        options = {option: value for option, value in given.items() if value is not None}
        print_findings(check_against_contract(name, options, parameters, profile), as_json=as_json)
        return
    with without_prints_of_models(as_json=as_json):
        _, factory = locate(name)
        report: ModelCheck = factory.check(weights=weights, model_config=model_config, device=device)
        card = report.card or describe_model(name).card
    if card is not None:
        warn_of_assumptions(card, parameters)
    if as_json:
        compared = None
        if card is not None and card.camera is not None and profile is not None:
            compared = [asdict(difference) for difference in camera_differences(card, profile.camera)]
        print_json({**_check_json(report), **card_json(card), "camera_differences": compared})
    else:
        _print_check(report, card, profile)


app.command("fetch")(fetch)


def _goals(model: "ModelDescription") -> str:
    if model.card is None:
        return UNKNOWN
    return "any" if model.card.goals is None else ", ".join(sorted(model.card.goals))


def _sensors(model: "ModelDescription") -> list[str]:
    from vsnbench.values.observation import Sensor

    return [] if model.card is None else [sensor.value for sensor in Sensor if sensor in model.card.sensors]


def _keywords(model: "ModelDescription") -> tuple[list[str], list[str]]:
    """Return the keywords of the class that are options of `vsnbench run`, and the others with their defaults."""
    from vsnbench.models.registry import FLAGS

    flags = [f"--{name.replace('_', '-')}" for name in model.keywords if name in FLAGS]
    others = [f"{name}={value}" if value else name for name, value in model.keywords.items() if name not in FLAGS]
    return flags, others


def _weights_state(model: "ModelDescription") -> str:
    from vsnbench.models.checkpoints.weights import embedded_weights, weights_directory

    if not model.weights_file:
        return "not needed"
    if (weights_directory() / model.weights_file).is_file():
        return "[green]found[/green]"
    if embedded_weights(model.weights_file) is not None:
        return "[green]embedded[/green] (demonstration)"
    return "[yellow]missing[/yellow]"


def _settings_of(model: "ModelDescription") -> list[tuple[str, str, str]]:
    if model.settings_class is None:
        return []
    rows = []
    for field, info in model.settings_class.model_fields.items():
        default = getattr(info.default, "value", info.default)
        text = str(default).lower() if isinstance(default, bool) else "not set" if default is None else str(default)
        rows.append((field, text, info.description or ""))
    return rows


def _description_json(model: "ModelDescription") -> dict[str, Any]:
    return {
        "name": model.name,
        "class": model.where,
        "summary": model.summary,
        **card_json(model.card, "goals"),
        "sensors": _sensors(model),
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
        "timings": [
            {"engine": timing.engine, "median_ms": round(timing.median_ms, 3), "steps": timing.steps}
            for timing in report.timings
        ],
        "warning": report.warning or None,
    }


def _print_check(report: "ModelCheck", card: "ModelCard | None", profile: "RobotProfile | None") -> None:
    console = Console()
    console.print(f"[bold]{escape(str(report.weights))}[/bold]", highlight=False, soft_wrap=True)
    rows = [("sha256", report.sha256), ("size", f"{report.size_bytes / 1e6:.1f} MB")]
    rows += [(fact.replace("_", " "), escape(_fact_text(value))) for fact, value in report.facts.items()]
    rows += [(name, escape(value)) for name, value in card_rows(card, profile)]
    rows += [("engine", escape(report.chosen_engine)), ("parity", _parity_text(report))]
    for timing in report.timings:
        rows.append(("time", f"{timing.median_ms:.1f} ms per step, median of {timing.steps}: {escape(timing.engine)}"))
    if len(report.timings) == 2:
        reference, chosen = report.timings
        rows.append(("", f"{reference.median_ms / chosen.median_ms:.2f} times the speed of the reference"))
    _print_rows(console, rows)


def _print_rows(console: Console, rows: list[tuple[str, str]]) -> None:
    """Print names and values, with the values in rich's markup."""
    grid = Table.grid(padding=(0, 2))
    for row in rows:
        grid.add_row(*row)
    console.print(grid, highlight=False, soft_wrap=True)


def _fact_text(value: str | int | float | bool | None) -> str:  # noqa: PYI041 - each has its own format
    if value is None:
        return "unknown"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _parity_text(report: "ModelCheck") -> str:
    if report.parity is None:
        return escape(report.warning) or "this is the reference engine"
    return (
        f"[green]agrees[/green] with PyTorch on the CPU: logits within {report.parity['largest_logit_difference']:.1e} "
        f"(allowed {report.parity['tolerance']:.1e}), same actions, {report.parity['steps']} steps"
    )
