"""`vsnbench run`: run the remaining trials of a campaign, or of several."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support import trial_options as trial
from vsnbench.cli.support.options import (
    Console,
    Database,
    Disturb,
    Live,
    Protocol,
    Rehearse,
    Results,
    Unattended,
    driver_page,
    execution_option,
    of_models,
    operator_page,
    requested_workers,
    results_directory,
    sites_of,
    what_to_keep,
)
from vsnbench.cli.support.output import Json, is_quiet, print_json, resumable, without_prints_of_models
from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_ROBOT, isolation_interpreter, load_config
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.models.remote.isolation import Isolation
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.runner.operator.provider import OperatorProvider
    from vsnbench.runner.setup.request import RunRequest


@resumable()
def command(  # noqa: PLR0913 - Typer needs a parameter per option
    context: typer.Context,
    model: trial.Model,
    goal: trial.Goal,
    site: trial.Site = None,
    robot: trial.Robot = BUILT_IN_ROBOT,
    starts: trial.Starts = None,
    repetitions: trial.Repetitions = 1,
    seed: trial.Seed = None,
    protocol: Protocol = BUILT_IN_PROTOCOL,
    max_steps: trial.MaxSteps = None,
    noise: trial.Noise = False,
    disturb: Disturb = None,
    continuous: trial.Continuous = None,
    rehearse: Rehearse = False,
    unattended: Unattended = False,
    console: Console = None,
    workers: trial.Workers = "auto",
    practice: Annotated[
        int | None,
        execution_option(
            "--practice", min=1, max=1000, help="Run this many practice trials of a person, and record nothing."
        ),
    ] = None,
    fail_fast: Annotated[bool, execution_option("--fail-fast", help="Stop at the first void episode.")] = False,
    watch: Annotated[
        bool, execution_option("--watch", help="Repeat the run when the model's files change; results are discarded.")
    ] = False,
    weights: trial.Weights = None,
    model_config: trial.ModelConfig = None,
    isolate: Annotated[
        str | None,
        trial.model_option(
            "--isolate", metavar="[PYTHON]", help="Own process for the model, with another Python interpreter if given."
        ),
    ] = None,
    results: Results = None,
    db: Database = None,
    keep: trial.Keep = "",
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
        vsnbench run --model pirlnav --goal bed --disturb blur=4,camera_tilt=-5
        vsnbench run --model oracle --goal all --protocol habitat-objectnav
        vsnbench run --model oracle-waypoints --goal chair --continuous 0.3
        vsnbench run --model pirlnav --goal all --workers ray://head:10001
        vsnbench run --model vlv,random --seed 0-4 --site flat:0-9 --goal all
        vsnbench run --model human:ada --goal chair
        vsnbench run --model human:ada --goal chair --site flat:7 --practice 3

    Ctrl-C halts the robot and ends the current episode as aborted.
    The same command resumes with the remaining trials.
    Each model, site and seed is a campaign of its own; several make a sweep.
    """
    models = tuple(map(trial.with_driver, trial.models_of(model)))
    seeds, sites = trial.seeds_of(seed), sites_of(site)
    if watch:
        from vsnbench.cli.support.watching import run_and_watch

        raise typer.Exit(run_and_watch(models, robot, workers, results, db, [weights, model_config]))
    from vsnbench.models.names import is_human
    from vsnbench.runner.executors.process import early_fork_server, wants_workers

    single = live or console is not None or rehearse or any(map(is_human, models))
    pooled = robot.partition(":")[0] == "simulated" and not single
    context.with_resource(early_fork_server(wanted=pooled and wants_workers(workers, all_starts=starts is None)))
    from vsnbench.cli.running.summary import run_and_exit, summary_console
    from vsnbench.protocol.disturbances import parse_disturbances
    from vsnbench.protocol.execution import parse_continuous
    from vsnbench.protocol.named import load_protocol
    from vsnbench.runner.operator.provider import OperatorProvider
    from vsnbench.runner.setup.request import RunRequest
    from vsnbench.runner.setup.selection import choose_starts, named_site
    from vsnbench.runner.setup.trial_setup import TrialSetupSpec

    page, config, first_site = operator_page(console), load_config(), named_site(sites[0])
    driver = driver_page(models[0], page)
    directory = results_directory(results, db) if practice is None else _discarded(context, models, results, db)
    setup = TrialSetupSpec(
        site=first_site,
        model=models[0],
        goals=tuple(goal),
        robot=robot,
        noise=noise,
        rehearsal=rehearse,
        disturbances=parse_disturbances(disturb or ()),
        parameters=load_protocol(protocol)
        .limited_to(max_steps)
        .executed(None if continuous is None else parse_continuous(continuous)),
        model_options=trial.model_options(weights, model_config),
        **of_models(config),
        isolation=None if isolate is None else _isolation(isolate, directory),
        keep=what_to_keep(keep, robot, live=live, has_operator=page is not None or rehearse),
    )
    request = RunRequest(
        setup=setup,
        results=directory,
        site=sites[0],
        starts=choose_starts(",".join(starts), first_site) if starts else (),
        repetitions=repetitions,
        seed=seeds[0],
        workers=requested_workers(workers),
        attended=page is not None,
        fail_fast=fail_fast,
        practice=practice,
    )
    if len(models) * len(seeds) * len(sites) == 1:
        provider = OperatorProvider(unattended, page.serve if page else None, driver.serve if driver else None)
        request = request.at(sites[0], first_site)
        run_and_exit(summary_console(), run_campaign_and_report, request, provider, live=live, as_json=as_json)
    if page is not None or any(map(is_human, models)):
        what = "--console" if page is not None else "--model human"
        raise UsageError(f"{what} is for one model, site and seed", advice="run each with its own command")
    from vsnbench.cli.running.sweep_summary import run_sweep_and_report, sweep_console

    run_and_exit(sweep_console(), run_sweep_and_report, request, models, seeds, sites, live=live, as_json=as_json)


def _discarded(
    context: typer.Context, models: Sequence[str], results: Path | None, db: str | None
) -> "ResultsDirectory":
    """Return a results directory for practice trials, which is removed with the context.

    Raises:
        UsageError: a model would practise, or the results were to be kept.
    """
    from vsnbench.files.temporary import ScratchDirectory
    from vsnbench.models.names import is_human

    if not all(map(is_human, models)):
        raise UsageError("--practice is for a person", advice="give --model human:NAME", code="practice-of-a-model")
    if results is not None or db is not None:
        raise UsageError("--practice records nothing", advice="leave out --results and --db, or --practice")
    return results_directory(context.with_resource(ScratchDirectory("practice")).path / "results", None)


def _isolation(python: str, results: "ResultsDirectory") -> "Isolation":
    """Return the process of `--isolate`, with the settings of section `[isolation]`."""
    from vsnbench.models.remote.isolation import Isolation
    from vsnbench.results.database_url import sqlite_path

    configured = load_config().isolation
    memory_bytes = None if configured.memory_gib is None else round(configured.memory_gib * 2**30)
    hidden: tuple[Path, ...] = ()
    if configured.hide_results:
        database = sqlite_path(results.database_url)
        names = [f"{database}{suffix}" for suffix in ("", "-wal", "-shm")] if database else []
        hidden = (results.path, *map(Path, names))
    return Isolation(Path(python) if python else isolation_interpreter(), memory_bytes, hidden)


def run_campaign_and_report(
    request: "RunRequest", provider: "OperatorProvider", *, live: bool, as_json: bool, following: str = ""
) -> int:
    """Run a campaign and return the exit code: 0 if every trial is done, 1 if some are left.

    Args:
        request: the campaign.
        provider: finds the operator.
        live: show the episodes.
        as_json: print the summary as JSON.
        following: the next command once every trial is done; the report if empty.

    Raises:
        Stopped: a person or the system asked to stop.
    """
    from vsnbench.cli.running.summary import fields_of, print_summary, summary_console
    from vsnbench.runner.setup.launch import launch
    from vsnbench.text.sanitize import counted
    from vsnbench.viewer.live import RerunEpisodes

    with without_prints_of_models(as_json=as_json), RerunEpisodes(live=live) as viewer:
        result = launch(request, provider, viewer)
        viewer.linger()
    if request.practice is not None:
        done = result.trials - result.left
        summary_console().print(f"{counted(done, 'practice trial')} done, nothing was recorded")
    elif not (as_json and is_quiet()):
        print_summary(summary_console(), result, request, following)
    if as_json:
        print_json(fields_of(result, request))
    return 1 if result.left or result.elsewhere else 0
