"""Options of the commands that run trials: which trials, with which model and robot, on how many workers."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.support.lists import split_list, split_numbers
from vsnbench.cli.support.options import configured_option, execution_option, options_under, record_option
from vsnbench.config import BUILT_IN_SITE, VARIABLE_OF
from vsnbench.errors import UsageError
from vsnbench.values.model.person import HUMAN

_LARGEST_SEED = 2**63 - 1

model_option = options_under("Model")
trials_option = options_under("Trials")

Model = Annotated[
    list[str],
    trials_option(
        "--model",
        "-m",
        metavar="A,B",
        help="Models: random, forward, oracle, frontier, pirlnav, vlv, package.module:Class, ws://HOST:PORT, or "
        "human:NAME for a person.",
    ),
]
Goal = Annotated[
    list[str], trials_option("--goal", "-g", metavar="A,B", help="Categories or goals of the site, or all.")
]
Site = Annotated[
    list[str] | None,
    trials_option(
        "--site",
        metavar="A,B",
        show_default=BUILT_IN_SITE,
        help="Sites: embedded ones, site files, or flat:0-19 (generated flats).",
    ),
]
Robot = Annotated[
    str,
    configured_option(
        "robot",
        "-r",
        help="Robot: simulated, simulated:lola2, turtlebot2 or another of `vsnbench robots list`.",
        rich_help_panel="Trials",
    ),
]
Starts = Annotated[
    list[str] | None,
    trials_option(
        "--starts", metavar="N,N-M", show_default="all of the site", help="Starting positions, like 1-15,20."
    ),
]
Repetitions = Annotated[
    int, trials_option("--repetitions", min=1, max=1000, help="Repetitions of each goal from each starting position.")
]
Seed = Annotated[
    list[str] | None,
    trials_option(
        "--seed",
        metavar="N,N-M",
        show_default="0",
        help="Seeds of all random choices, like 0-9; one campaign per seed.",
    ),
]
MaxSteps = Annotated[
    int | None,
    trials_option(
        "--max-steps", min=1, max=100_000, show_default="the protocol's", help="Maximum number of actions per episode."
    ),
]
Noise = Annotated[bool, execution_option("--noise", help="Add noise to simulated depth and odometry.")]
Continuous = Annotated[
    str | None,
    execution_option(
        "--continuous",
        metavar="SECONDS|measured",
        help="The robot drives on while the model thinks, for a declared latency or as long as the model takes.",
    ),
]
Workers = Annotated[
    str,
    execution_option(
        "--workers",
        metavar="N|auto|ray://HEAD:PORT",
        help="Number of simulated trials at a time (auto: by cores and memory), or a Ray cluster.",
    ),
]
Weights = Annotated[
    Path | None,
    model_option("--weights", "-w", help="File of the model's weights, or 'embedded' for the packaged ones."),
]
ModelConfig = Annotated[Path | None, model_option("--model-config", help="YAML file of the model's settings.")]

Keep = Annotated[
    str,
    record_option(
        "--keep",
        metavar="all|images|none",
        help="Files of an episode: images and a Rerun copy (all), images, or none (simulation only).",
        show_default="all with an operator, else images",
    ),
]


def models_of(values: Sequence[str]) -> tuple[str, ...]:
    """Return the models of `--model`.

    Raises:
        UsageError: there are none.
    """
    if models := split_list(values):
        return models
    raise UsageError("no model given", advice="name one with --model, for example --model oracle")


def with_driver(model: str) -> str:
    """Return a model with the name of its driver, which is asked at the terminal if `human` has none."""
    is_unnamed = model == HUMAN and not os.environ.get(VARIABLE_OF["operator"])
    if not is_unnamed or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return model
    return f"{HUMAN}:{typer.prompt('Name of the driver, which is recorded', err=True)}"


def seeds_of(values: Sequence[str] | None) -> tuple[int, ...]:
    """Return the seeds of `--seed`, or 0.

    Raises:
        UsageError: a value is not a list of seeds.
    """
    seeds = split_numbers(values, "--seed", "0-9") or (0,)
    if max(seeds) > _LARGEST_SEED:
        raise UsageError(f"--seed {max(seeds)}: the largest seed is {_LARGEST_SEED}", code="invalid-numbers")
    return seeds


def model_options(weights: Path | None, model_config: Path | None) -> dict[str, object]:
    """Return the options of the models that were typed."""
    return {name: value for name, value in (("weights", weights), ("model_config", model_config)) if value is not None}
