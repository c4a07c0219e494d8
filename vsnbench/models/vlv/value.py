"""What an image promises for a goal: the value network where there are weights, else 0 and a name that says so."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.torch_runtime import require_torch
from vsnbench.models.vlv.goals import VALUE_CLASSES
from vsnbench.models.weights import find_weights, weights_directory

if TYPE_CHECKING:
    from vsnbench.models.vlv.value_weights import ValueWeights

logger = logging.getLogger(__name__)

FILE_NAME = "vlv_model.torch"
WITHOUT = "no value network"


class Value(Protocol):
    """Says what a view promises."""

    label: str
    """What it is, in words, for every record and report."""
    sha256: str
    """Of its weights; empty without any."""

    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:
        """Return the value of an image (H, W, 3) for a class of `VALUE_CLASSES`."""
        ...


class NoValue:
    """The original's `detector` mode: every view is worth the same."""

    label = WITHOUT
    sha256 = ""

    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:  # noqa: ARG002 - nothing is looked at
        """Return 0."""
        return 0.0


class LearnedValue:
    """The value network."""

    def __init__(self, weights: "ValueWeights", device: str) -> None:
        from vsnbench.models.vlv.value_network import build_value_network

        self.label = f"{weights.path.name} (ResNet-18 value network)"
        self.sha256 = weights.sha256
        self._network = build_value_network(weights.tensors, device)

    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:
        """Return the largest Q value of the class over the actions.

        Raises:
            ModelError: the network's answer is not finite.
        """
        from vsnbench.models.vlv.value_network import q_values

        value = float(q_values(self._network, rgb)[VALUE_CLASSES.index(name)].max())
        if not np.isfinite(value):
            raise ModelError("vlv: the value network answered with a number that is not finite")
        return value


def open_value(weights: str | Path | None, device: str) -> Value:
    """Return the value network, or what stands in for it where no weights are named or found.

    Raises:
        ModelError: the weights that were named or found cannot be used.
    """
    if weights is None and not (weights_directory() / FILE_NAME).is_file():
        logger.warning("vlv runs without its value network: no weights at %s", weights_directory() / FILE_NAME)
        return NoValue()
    path = find_weights("vlv", FILE_NAME, Path(weights) if weights is not None else None)
    require_torch()
    from vsnbench.models.torch_runtime import available_device
    from vsnbench.models.vlv.value_weights import read_value_weights

    return LearnedValue(read_value_weights(path), available_device(device))
