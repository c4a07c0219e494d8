"""`vsnbench run`: run what is left of a campaign."""

import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import (
    RECORD_PANEL,
    Console,
    ConsoleAddress,
    ConsoleCertificate,
    ConsoleKey,
    ConsolePort,
    Database,
    Results,
    operator_page,
    what_is_kept,
    workers_asked,
)
from vsnbench.cli.output import Json, goes_on_after_ctrl_c, print_json
from vsnbench.errors import UsageError
from vsnbench.lab_file import BUILT_IN_ROBOT, BUILT_IN_SITE, VARIABLE_OF

if TYPE_CHECKING:
    from vsnbench.runner.attendance import Attendance
    from vsnbench.runner.request import RunRequest

_WHAT = "What to run"
_HOW = "How"
_MODEL = "Model"
_DEVELOPMENT = "While a model is written"


@goes_on_after_ctrl_c()
def command(
    context: typer.Context,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            "-m",
            help="random, forward, oracle, pirlnav, ..., package.module:Class, or ws://host:port; several with commas",
            rich_help_panel=_WHAT,
        ),
    ],
    goal: Annotated[
        list[str],
        typer.Option("--goal", "-g", help="goal category, several with commas, or all", rich_help_panel=_WHAT),
    ],
    site: Annotated[
        str,
        typer.Option(
            "--site",
            envvar=VARIABLE_OF["site"],
            show_envvar=False,
            help="embedded site, a site file, or twin:N, a generated flat",
            rich_help_panel=_WHAT,
        ),
    ] = BUILT_IN_SITE,
    sites: Annotated[
        str | None,
        typer.Option("--sites", help="several: apartment,twins:0-19 (generated flats)", rich_help_panel=_WHAT),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            "-r",
            envvar=VARIABLE_OF["robot"],
            show_envvar=False,
            help="simulated, simulated:lola2, turtlebot2, ...",
            rich_help_panel=_WHAT,
        ),
    ] = BUILT_IN_ROBOT,
    starts: Annotated[
        str | None,
        typer.Option("--starts", help="starting positions, like 1-15,20; all when absent", rich_help_panel=_WHAT),
    ] = None,
    repetitions: Annotated[
        int,
        typer.Option("--repetitions", min=1, max=1000, help="times each goal meets each start", rich_help_panel=_WHAT),
    ] = 1,
    max_steps: Annotated[
        int,
        typer.Option(
            "--max-steps", min=1, max=100_000, help="cap on actions; the paper's is 150", rich_help_panel=_HOW
        ),
    ] = 150,
    seed: Annotated[
        int,
        typer.Option(
            "--seed",
            min=0,
            max=2**63 - 1,
            metavar="N",
            help="every random choice follows from it",
            rich_help_panel=_HOW,
        ),
    ] = 0,
    seeds: Annotated[
        str | None, typer.Option("--seeds", help="a campaign for each, like 0-9", rich_help_panel=_WHAT)
    ] = None,
    shuffle: Annotated[
        bool, typer.Option("--shuffle", help="run the trials in random order", rich_help_panel=_HOW)
    ] = False,
    noise: Annotated[
        bool, typer.Option("--noise", help="noisy depth and odometry in simulation", rich_help_panel=_HOW)
    ] = False,
    pretend_real: Annotated[
        bool,
        typer.Option(
            "--pretend-real",
            help="rehearse at a desk: the simulated robot must be placed and judged by a person",
            rich_help_panel=_HOW,
        ),
    ] = False,
    workers: Annotated[
        str,
        typer.Option(
            "--workers",
            metavar="N",
            help="trials at once in simulation: auto is as many as cores and memory allow",
            rich_help_panel=_HOW,
        ),
    ] = "auto",
    cluster: Annotated[
        str,
        typer.Option(
            "--cluster",
            metavar="RAY",
            help="run the trials on a Ray cluster: ray://head:10001",
            show_default=False,
            rich_help_panel=_HOW,
        ),
    ] = "",
    gpus: Annotated[
        float,
        typer.Option(
            "--gpus",
            min=0,
            max=64,
            metavar="X",
            help="GPUs that each worker of the cluster holds; 0.25 puts four on one",
            show_default=False,
            rich_help_panel=_HOW,
        ),
    ] = 0.0,
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights", help="file of the model's weights, or 'embedded' for those inside", rich_help_panel=_MODEL
        ),
    ] = None,
    model_config: Annotated[
        Path | None, typer.Option("--model-config", help="YAML file of the model's settings", rich_help_panel=_MODEL)
    ] = None,
    device: Annotated[
        str | None, typer.Option("--device", help="auto, cpu, cuda or mps", rich_help_panel=_MODEL)
    ] = None,
    act_timeout: Annotated[
        float | None,
        typer.Option(
            "--act-timeout",
            min=0.1,
            max=600,
            metavar="SECONDS",
            help="a model that answers later is lost; 10 when absent for one elsewhere",
            rich_help_panel=_MODEL,
        ),
    ] = None,
    isolate: Annotated[
        bool, typer.Option("--isolate", help="run the model in a process of its own", rich_help_panel=_MODEL)
    ] = False,
    python: Annotated[
        Path | None,
        typer.Option("--python", help="that process's interpreter; means --isolate", rich_help_panel=_MODEL),
    ] = None,
    isolate_memory: Annotated[
        float | None,
        typer.Option(
            "--isolate-memory",
            min=0.1,
            metavar="GIB",
            help="memory that process may have; means --isolate",
            rich_help_panel=_MODEL,
        ),
    ] = None,
    results: Results = None,
    db: Database = None,
    unattended: Annotated[
        bool,
        typer.Option(
            "--unattended", help="nobody is beside a real robot; its episodes await judgement", rich_help_panel=_HOW
        ),
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="do not ask before a long sweep", rich_help_panel=_HOW)
    ] = False,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="end at the first void episode", rich_help_panel=_DEVELOPMENT)
    ] = False,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="run again whenever the model's files change; in simulation, into a directory that is thrown away",
            rich_help_panel=_DEVELOPMENT,
        ),
    ] = False,
    record: Annotated[
        str,
        typer.Option(
            "--record",
            metavar="full|lean|numbers",
            help="images and Rerun's copies; images; or neither, for simulated sweeps",
            show_default="full with somebody beside the robot, else lean",
            rich_help_panel=RECORD_PANEL,
        ),
    ] = "",
    live: Annotated[
        bool, typer.Option("--live", help="show each episode in Rerun as it happens", rich_help_panel=RECORD_PANEL)
    ] = False,
    console: Console = False,
    console_address: ConsoleAddress = "",
    console_port: ConsolePort = None,
    console_certificate: ConsoleCertificate = None,
    console_key: ConsoleKey = None,
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
        vsnbench run --model mine:Agent --python ~/envs/old/bin/python --goal bed
        vsnbench run --model forward --goal chair --live
        vsnbench run --model oracle --goal chair --starts 3 --pretend-real
        vsnbench run --model vlv --goal all --robot lola2 --console
        vsnbench run --model oracle --goal all --site lab.yaml
        vsnbench run --model pirlnav --goal all --cluster ray://head:10001
        vsnbench run --model vlv,random --seeds 0-4 --sites twins:0-9 --goal all

    Ctrl-C halts the robot and ends the current episode as aborted.
    The same command goes on with the trials that are left.
    Another seed, site, model or parameter is another campaign; several make a sweep.
    """
    if watch:
        from vsnbench.cli.watching import run_and_watch

        raise typer.Exit(run_and_watch(model, robot, cluster, results, db, [weights, model_config]))
    from vsnbench.runner.pool.process import early_fork_server, wants_workers

    several = robot.partition(":")[0] == "simulated" and not (live or cluster or console or pretend_real)
    wanted = several and wants_workers(workers, all_starts=starts is None)
    context.with_resource(early_fork_server(wanted=wanted))
    from vsnbench.cli.run_summary import leave_strays_behind
    from vsnbench.models.remote.isolation import Isolation
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.runner.attendance import TerminalAttendance
    from vsnbench.runner.pool.capacity import WorkersAsked
    from vsnbench.runner.request import RunRequest

    apart = isolate or python is not None or isolate_memory is not None
    elsewhere = apart or model.startswith(("ws://", "wss://"))
    options = {
        "weights": weights,
        "model_config": model_config,
        "device": device,
        "act_timeout": act_timeout if elsewhere else None,
    }
    page = operator_page(console, console_address, console_port, console_certificate, console_key)
    memory_bytes = None if isolate_memory is None else round(isolate_memory * 2**30)
    request = RunRequest(
        model=model,
        goals=tuple(goal),
        results=ResultsDirectory.locate(results, db),
        site=site,
        robot=robot,
        starts=starts,
        repetitions=repetitions,
        max_steps=max_steps,
        seed=seed,
        shuffle=shuffle,
        noise=noise,
        pretend_real=pretend_real,
        model_options={name: value for name, value in options.items() if value is not None},
        act_timeout_s=None if elsewhere else act_timeout,
        isolation=Isolation(python, memory_bytes) if apart else None,
        workers=WorkersAsked(workers_asked(workers), cluster, gpus),
        kept=what_is_kept(record, live=live),
        attended=page is not None,
        fail_fast=fail_fast,
    )
    before = frozenset(threading.enumerate())
    if "," in model or seeds is not None or sites is not None:
        from vsnbench.cli.sweep_summary import sweep_and_tell

        if page is not None:
            raise UsageError("--console is for one model, site and seed: nobody stands beside a sweep")

        code = sweep_and_tell(request, model, seeds, sites, live=live, yes=yes, as_json=as_json)
    else:
        code = _run_and_tell(request, TerminalAttendance(unattended, page), live=live, as_json=as_json)
    leave_strays_behind(code, before)
    raise typer.Exit(code)


def _run_and_tell(request: "RunRequest", attendance: "Attendance", *, live: bool, as_json: bool) -> int:
    """Run and return the exit code: 0 when every trial is done, 1 when some are left, 129, 130 or 143 when stopped."""
    from rich.console import Console

    from vsnbench.cli.run_summary import fields_of, stopped_words, tell
    from vsnbench.runner.launch import launch
    from vsnbench.runner.stopping import Stopped
    from vsnbench.viewer.live import RerunEpisodes

    console = Console(file=sys.stderr, highlight=False, soft_wrap=not sys.stderr.isatty())
    try:
        with RerunEpisodes(live=live) as viewer:
            launched = launch(request, attendance, viewer)
            viewer.linger()
    except Stopped as stopped:
        console.print(stopped_words(stopped))
        return stopped.request.exit_code
    tell(console, launched, request)
    if as_json:
        print_json(fields_of(launched, request))
    return 1 if launched.result.left or launched.result.elsewhere else 0
