"""`vsnbench run`: run the remaining trials of a campaign, or of several."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.lists import split_list, split_numbers
from vsnbench.cli.support.options import (
    EXECUTION_PANEL,
    RECORD_PANEL,
    Console,
    Database,
    Live,
    Protocol,
    Rehearse,
    Results,
    Unattended,
    fit_of,
    operator_page,
    requested_workers,
    sites_of,
    what_to_keep,
)
from vsnbench.cli.support.output import Json, is_quiet, print_json, resumable
from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_ROBOT, BUILT_IN_SITE, VARIABLE_OF, load_config
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation
    from vsnbench.runner.operator.provider import OperatorProvider
    from vsnbench.runner.setup.request import RunRequest

_TRIALS = "Trials"
_MODEL = "Model"
_LARGEST_SEED = 2**63 - 1


@resumable()
def command(  # noqa: PLR0913 - Typer needs a parameter per option
    context: typer.Context,
    model: Annotated[
        list[str],
        typer.Option(
            "--model",
            "-m",
            metavar="A,B",
            help="Models: random, forward, oracle, frontier, pirlnav, vlv, package.module:Class or ws://HOST:PORT.",
            rich_help_panel=_TRIALS,
        ),
    ],
    goal: Annotated[
        list[str],
        typer.Option(
            "--goal",
            "-g",
            metavar="A,B",
            help="Categories or goals of the site, or all.",
            rich_help_panel=_TRIALS,
        ),
    ],
    site: Annotated[
        list[str] | None,
        typer.Option(
            "--site",
            metavar="A,B",
            show_default=BUILT_IN_SITE,
            help="Sites: embedded ones, site files, or flat:0-19 (generated flats).",
            rich_help_panel=_TRIALS,
        ),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            "-r",
            envvar=VARIABLE_OF["robot"],
            show_envvar=False,
            help="Robot: simulated, simulated:lola2, turtlebot2 or another of `vsnbench robots list`.",
            rich_help_panel=_TRIALS,
        ),
    ] = BUILT_IN_ROBOT,
    starts: Annotated[
        list[str] | None,
        typer.Option(
            "--starts",
            metavar="N,N-M",
            show_default="all of the site",
            help="Starting positions, like 1-15,20.",
            rich_help_panel=_TRIALS,
        ),
    ] = None,
    repetitions: Annotated[
        int,
        typer.Option(
            "--repetitions",
            min=1,
            max=1000,
            help="Repetitions of each goal from each starting position.",
            rich_help_panel=_TRIALS,
        ),
    ] = 1,
    seed: Annotated[
        list[str] | None,
        typer.Option(
            "--seed",
            metavar="N,N-M",
            show_default="0",
            help="Seeds of all random choices, like 0-9; one campaign per seed.",
            rich_help_panel=_TRIALS,
        ),
    ] = None,
    protocol: Protocol = BUILT_IN_PROTOCOL,
    max_steps: Annotated[
        int | None,
        typer.Option(
            "--max-steps",
            min=1,
            max=100_000,
            show_default="the protocol's",
            help="Maximum number of actions per episode.",
            rich_help_panel=_TRIALS,
        ),
    ] = None,
    shuffle: Annotated[
        bool, typer.Option("--shuffle", help="Run the trials in random order.", rich_help_panel=EXECUTION_PANEL)
    ] = False,
    noise: Annotated[
        bool,
        typer.Option("--noise", help="Add noise to simulated depth and odometry.", rich_help_panel=EXECUTION_PANEL),
    ] = False,
    fit: Annotated[
        str,
        typer.Option(
            "--fit",
            metavar="full|crop",
            help="Images for the model: the robot's (full), or cropped to the field of view that the model was trained "
            "with (crop).",
            rich_help_panel=_MODEL,
        ),
    ] = "full",
    rehearse: Rehearse = False,
    unattended: Unattended = False,
    console: Console = None,
    workers: Annotated[
        str,
        typer.Option(
            "--workers",
            metavar="N|auto|ray://HEAD:PORT",
            help="Number of simulated trials at a time (auto: by cores and memory), or a Ray cluster.",
            rich_help_panel=EXECUTION_PANEL,
        ),
    ] = "auto",
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Stop at the first void episode.", rich_help_panel=EXECUTION_PANEL)
    ] = False,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="Repeat the run when the model's files change; results are discarded.",
            rich_help_panel=EXECUTION_PANEL,
        ),
    ] = False,
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights",
            "-w",
            help="File of the model's weights, or 'embedded' for the packaged ones.",
            rich_help_panel=_MODEL,
        ),
    ] = None,
    model_config: Annotated[
        Path | None, typer.Option("--model-config", help="YAML file of the model's settings.", rich_help_panel=_MODEL)
    ] = None,
    isolate: Annotated[
        str | None,
        typer.Option(
            "--isolate",
            metavar="[PYTHON]",
            help="Own process for the model, with another Python interpreter if given.",
            rich_help_panel=_MODEL,
        ),
    ] = None,
    results: Results = None,
    db: Database = None,
    keep: Annotated[
        str,
        typer.Option(
            "--keep",
            metavar="all|images|none",
            help="Files of an episode: images and a Rerun copy (all), images, or none (simulation only).",
            show_default="all with an operator, else images",
            rich_help_panel=RECORD_PANEL,
        ),
    ] = "",
    live: Live = False,
    as_json: Json = False,
) -> None:
    """Run the trials of a campaign that have no valid episode yet, and record every step.

    [bold]Examples[/bold]

        vsnbench run --model pirlnav --goal chair
        vsnbench run --model random --goal all --starts 1-5
        vsnbench run --model pirlnav --weights il.ckpt --goal all
        vsnbench run --model mylab.policy:Policy --goal bed,sofa
        vsnbench run --model mylab.policy:Policy --goal chair --starts 1 --watch
        vsnbench run --model ws://gpu-box:8765 --goal all
        vsnbench run --model mine:Agent --isolate ~/envs/old/bin/python --goal bed
        vsnbench run --model forward --goal chair --live
        vsnbench run --model oracle --goal chair --starts 3 --rehearse
        vsnbench run --model vlv --goal all --robot lola2 --console
        vsnbench run --model oracle --goal all --site lab.yaml
        vsnbench run --model oracle --goal all --protocol habitat-objectnav
        vsnbench run --model pirlnav --goal all --workers ray://head:10001
        vsnbench run --model vlv,random --seed 0-4 --site flat:0-9 --goal all

    Ctrl-C halts the robot and ends the current episode as aborted.
    The same command resumes with the remaining trials.
    Each model, site and seed is a campaign of its own; several make a sweep.
    """
    models, seeds, sites = split_list(model), split_numbers(seed, "--seed", "0-9") or (0,), sites_of(site)
    if not models:
        raise UsageError("no model given", advice="name one with --model, for example --model oracle")
    if max(seeds) > _LARGEST_SEED:
        raise UsageError(f"--seed {max(seeds)}: the largest seed is {_LARGEST_SEED}", code="invalid-numbers")
    if watch:
        from vsnbench.cli.support.watching import run_and_watch

        raise typer.Exit(run_and_watch(models, robot, workers, results, db, [weights, model_config]))
    from vsnbench.runner.executors.process import early_fork_server, wants_workers

    pooled = robot.partition(":")[0] == "simulated" and not (live or console is not None or rehearse)
    context.with_resource(early_fork_server(wanted=pooled and wants_workers(workers, all_starts=starts is None)))
    from vsnbench.cli.running.summary import ThreadsAndProcesses, exit_despite_threads
    from vsnbench.protocol.named import load_protocol
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.runner.operator.provider import TerminalOperatorProvider
    from vsnbench.runner.setup.request import RunRequest

    configured = load_config().models
    act_timeout_s = configured.act_timeout_s
    remote = isolate is not None or any(name.startswith(("ws://", "wss://")) for name in models)
    options = {
        "weights": weights,
        "model_config": model_config,
        "act_timeout": act_timeout_s if remote else None,
    }
    page = operator_page(console)
    request = RunRequest(
        model=models[0],
        goals=tuple(goal),
        results=ResultsDirectory.locate(results, db),
        site=sites[0],
        robot=robot,
        starts=",".join(starts) if starts else None,
        repetitions=repetitions,
        parameters=load_protocol(protocol).limited_to(max_steps),
        device=configured.device,
        seed=seeds[0],
        shuffle=shuffle,
        noise=noise,
        rehearsal=rehearse,
        fit=fit_of(fit),
        model_options={name: value for name, value in options.items() if value is not None},
        act_timeout_s=None if remote else act_timeout_s,
        isolation=None if isolate is None else _isolation(isolate),
        workers=requested_workers(workers),
        keep=what_to_keep(keep, live=live),
        attended=page is not None,
        fail_fast=fail_fast,
    )
    with ThreadsAndProcesses.now() as before:
        if len(models) * len(seeds) * len(sites) > 1:
            from vsnbench.cli.running.sweep_summary import run_sweep_and_report

            if page is not None:
                raise UsageError("--console is for one model, site and seed", advice="run each with its own command")
            code = run_sweep_and_report(request, models, seeds, sites, live=live, as_json=as_json)
        else:
            code = _run_and_report(request, TerminalOperatorProvider(unattended, page), live=live, as_json=as_json)
    exit_despite_threads(code, before)
    raise typer.Exit(code)


def _isolation(python: str) -> "Isolation":
    """Return the process of `--isolate`, with the settings of section `[isolation]`."""
    from vsnbench.models.remote.isolation import Isolation

    configured = load_config().isolation
    memory_bytes = None if configured.memory_gib is None else round(configured.memory_gib * 2**30)
    return Isolation(Path(python) if python else configured.python, memory_bytes)


def _run_and_report(request: "RunRequest", provider: "OperatorProvider", *, live: bool, as_json: bool) -> int:
    """Run a campaign and return the exit code: 0 if every trial is done, 1 if some are left, 129 to 143 if stopped."""
    from vsnbench.cli.running.summary import fields_of, print_summary, stopped_message, summary_console
    from vsnbench.runner.setup.launch import launch
    from vsnbench.runner.stopping.requests import Stopped
    from vsnbench.viewer.live import RerunEpisodes

    console = summary_console()
    try:
        with RerunEpisodes(live=live) as viewer:
            launched = launch(request, provider, viewer)
            viewer.linger()
    except Stopped as stopped:
        console.print(stopped_message(stopped))
        return stopped.request.exit_code
    if not (as_json and is_quiet()):
        print_summary(console, launched, request)
    if as_json:
        print_json(fields_of(launched, request))
    return 1 if launched.result.left or launched.result.elsewhere else 0
