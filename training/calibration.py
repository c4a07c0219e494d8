"""Choice of the bias of STOP's logit, on sites outside training and validation."""

import logging
from pathlib import Path
from typing import Final

import torch

from training.atomic_files import write_atomic
from training.recipe import Recipe
from training.rollout import INDEX
from training.stage import Row
from training.validation import Validator
from vsnbench.models.pirlnav.network import PIRLNavNetwork
from vsnbench.values.movement import Action

logger = logging.getLogger(__name__)
_STOP: Final = INDEX[Action.STOP]


def calibrate_stop(recipe: Recipe, network: PIRLNavNetwork, output: Path) -> list[Row]:
    """Run episodes with each bias and set the best one in the network's action head.

    Returns:
        The log: a row for each bias.

    Raises:
        TrainingError: the disk is full or not writable.
    """
    path, rows = output / "calibration.pt", []
    if path.is_file():
        rows = torch.load(path, weights_only=True)
    validator = Validator(recipe, recipe.calibration_seeds, recipe.calibration.episodes)
    bias = network.action_distribution.get_parameter("linear.bias")
    learnt = float(bias[_STOP].detach())
    for added in recipe.calibration.stop_biases[len(rows) :]:
        with torch.no_grad():
            bias[_STOP] = learnt + added
        rows.append({"stage": "calibration", "stop_bias": added, **validator.examine(network)})
        logger.info("calibration %s", rows[-1])
        write_atomic(path, lambda file: torch.save(rows, file))
    best = max(rows, key=lambda row: row["validation_successes"])
    with torch.no_grad():
        bias[_STOP] = learnt + best["stop_bias"]
    return rows
