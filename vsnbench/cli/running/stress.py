"""`vsnbench stress`: what each disturbance of a model's camera and odometry costs in success."""

import logging
from pathlib import Path
from typing import Annotated

from vsnbench.cli.support import trial_options as trial
from vsnbench.cli.support.lists import split_numbers
from vsnbench.cli.support.options import (
    Database,
    Protocol,
    Results,
    execution_option,
    of_models,
    record_option,
    requested_workers,
    results_directory,
    sites_of,
    what_to_keep,
)
from vsnbench.cli.support.output import Json, resumable, without_prints_of_models
from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_ROBOT, load_config

logger = logging.getLogger(__name__)


@resumable()
def command(  # noqa: PLR0913 - Typer needs a parameter per option
    model: trial.Model,
    goal: trial.Goal,
    site: trial.Site = None,
    robot: trial.Robot = BUILT_IN_ROBOT,
    starts: trial.Starts = None,
    repetitions: trial.Repetitions = 1,
    seed: trial.Seed = None,
    protocol: Protocol = BUILT_IN_PROTOCOL,
    max_steps: trial.MaxSteps = None,
    disturb: Annotated[
        list[str] | None,
        execution_option(
            "--disturb",
            metavar="A,B",
            show_default="the standard set",
            help="Disturbances, each on its own: blur, glare, low_light, depth_holes, camera_height, camera_tilt, "
            "dropped_frames, odometry_drift, stale_frames, latency, or continuous.",
        ),
    ] = None,
    severity: Annotated[
        list[str] | None,
        execution_option(
            "--severity", metavar="N,N", show_default="1,3,5", help="Severities of each disturbance, from 1 to 5."
        ),
    ] = None,
    detect: Annotated[
        int | None,
        execution_option(
            "--detect",
            metavar="POINTS",
            min=1,
            max=99,
            help="Loss of success rate, in points, to be shown with 80 % power: a smaller test is refused.",
        ),
    ] = None,
    noise: trial.Noise = False,
    workers: trial.Workers = "auto",
    weights: trial.Weights = None,
    model_config: trial.ModelConfig = None,
    figure: Annotated[
        Path | None,
        record_option(
            "--figure", metavar="FILE", help="File of a figure, success rate against severity: .svg, .pdf or .png."
        ),
    ] = None,
    keep: trial.Keep = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Measure what disturbances cost a model in success, in pairs with undisturbed trials.

    [bold]Examples[/bold]

        vsnbench stress --model pirlnav --goal chair
        vsnbench stress --model pirlnav,vlv --goal all --figure stress.svg
        vsnbench stress --model vlv --goal bed --disturb dropped_frames
        vsnbench stress --model vlv --goal all --severity 5 --detect 40
        vsnbench stress --model oracle-waypoints --goal all --disturb continuous
        vsnbench stress --model mylab.policy:Policy --goal chair --json

    Runs every trial undisturbed and with each disturbance at each severity,
    from the same starting positions with the same seeds, in simulation.
    Disturbances of sensors that a model does not use are left out.
    Ctrl-C ends the current episode; the same command resumes.
    The same command with every trial done prints the result again.
    """
    from vsnbench.cli.running.stress_summary import check_figure, run_stress
    from vsnbench.cli.running.summary import run_and_exit
    from vsnbench.cli.running.sweep_summary import sweep_console
    from vsnbench.models.names import require_no_person
    from vsnbench.protocol.named import load_protocol
    from vsnbench.runner.setup.request import RunRequest
    from vsnbench.runner.setup.selection import choose_starts, named_site
    from vsnbench.runner.setup.stress import (
        check_detects,
        check_robot,
        conditions_of,
        design_of_stress,
        power_line,
        seen_by,
        under_conditions,
        unseen_by,
        weakness_of,
    )
    from vsnbench.runner.setup.sweep import plan_sweep
    from vsnbench.runner.setup.trial_setup import TrialSetupSpec

    names = [name for value in disturb or () for name in value.split(",")]
    conditions = conditions_of(names, split_numbers(severity, "--severity", "1,3,5"))
    check_figure(figure)
    check_robot(robot)
    models, seeds, sites = trial.models_of(model), trial.seeds_of(seed), sites_of(site)
    for name in models:
        require_no_person(name, "stress")
    config, first_site = load_config(), named_site(sites[0])
    setup = TrialSetupSpec(
        site=first_site,
        model=models[0],
        goals=tuple(goal),
        robot=robot,
        noise=noise,
        parameters=load_protocol(protocol).limited_to(max_steps),
        model_options=trial.model_options(weights, model_config),
        **of_models(config),
        keep=what_to_keep(keep, robot),
    )
    request = RunRequest(
        setup=setup,
        results=results_directory(results, db),
        site=sites[0],
        starts=choose_starts(",".join(starts), first_site) if starts else (),
        repetitions=repetitions,
        workers=requested_workers(workers),
    )
    with without_prints_of_models(as_json=as_json):
        campaigns = plan_sweep(request, models, seeds, sites)
        unseen = unseen_by(seen_by(campaigns), conditions)
    for name, left_out in unseen.items():
        if left_out:
            logger.warning(
                "%s: without %s, because the model does not use what they change; the same success rate would not show "
                "that it is robust",
                name,
                ", ".join(left_out),
            )
    sweep = under_conditions(campaigns, conditions, unseen)
    design = design_of_stress(sweep)
    if detect is not None:
        check_detects(design, detect / 100)
    if weakness := weakness_of(design):
        logger.warning("%s", weakness)
    else:
        sweep_console().print(power_line(design))
    run_and_exit(sweep_console(), run_stress, sweep, request, unseen, figure, as_json=as_json)
