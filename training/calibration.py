"""Chooses what to add to the logit of STOP, on twins that were neither trained nor validated on."""

import logging
from pathlib import Path
from typing import Final

import torch

from training.recipe import Recipe
from training.rollout import INDEX
from training.stage import Row
from training.validation import Validator
from training.whole_files import write_whole
from vsnbench.models.pirlnav.network import PIRLNavNetwork
from vsnbench.protocol.actions import Action

logger = logging.getLogger(__name__)
_STOP: Final = INDEX[Action.STOP]


def calibrate_stop(recipe: Recipe, network: PIRLNavNetwork, output: Path) -> list[Row]:
    """Drive episodes with each bias, and give the network's action head the best one.

    Returns:
        The log: a row for each bias.

    Raises:
        TrainingError: the disk is full or cannot be written.
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
        write_whole(path, lambda file: torch.save(rows, file))
    best = max(rows, key=lambda row: row["validation_successes"])
    with torch.no_grad():
        bias[_STOP] = learnt + best["stop_bias"]
    return rows
