"""Value of an image for a goal: the value network if there are weights, else 0."""

import logging
from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.torch_runtime import available_device, require_torch
from vsnbench.models.checkpoints.weights import find_weights, weights_directory
from vsnbench.models.vlv.goals import VALUE_CLASSES

if TYPE_CHECKING:
    from vsnbench.models.vlv.value.weights import ValueWeights

logger = logging.getLogger(__name__)

FILE_NAME = "vlv_model.torch"
WITHOUT = "no value network"


class Value(ABC):
    """Estimates the value of a view."""

    label: str
    """Description for records and reports."""
    sha256: str
    """Hash of its weights; empty without weights."""
    device: str = "cpu"
    """Device of its network, such as `cpu` or `cuda`."""
    reads_images: bool = True
    """Whether its values depend on the image."""

    @abstractmethod
    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:
        """Return the value of an image (H, W, 3) for a class of `VALUE_CLASSES`."""


class NoValue(Value):
    """The original's `detector` mode: every view has the same value."""

    sha256 = ""
    reads_images = False

    def __init__(self, label: str = WITHOUT) -> None:
        self.label = label

    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:  # noqa: ARG002 - every value is 0
        """Return 0."""
        return 0.0


class LearnedValue(Value):
    """The value network."""

    def __init__(self, weights: "ValueWeights", device: str) -> None:
        from vsnbench.models.vlv.value.network import build_value_network

        self.label = f"{weights.path.name} (ResNet-18 value network)"
        self.sha256 = weights.sha256
        self.device = device
        self._network = build_value_network(weights.tensors, device)

    def of(self, rgb: npt.NDArray[np.uint8], name: str) -> float:
        """Return the largest Q value of the class over the actions.

        Raises:
            ModelError: the network's output is not finite.
        """
        from vsnbench.models.vlv.value.network import q_values

        value = float(q_values(self._network, rgb)[VALUE_CLASSES.index(name)].max())
        if not np.isfinite(value):
            raise ModelError("vlv: the value network's output is not finite")
        return value


def open_value(weights: str | Path | None, device: str) -> Value:
    """Return the value network, or `NoValue` if there are no weights.

    Raises:
        ModelError: the weights cannot be used.
    """
    if weights is None and not (weights_directory() / FILE_NAME).is_file():
        logger.warning("vlv runs without its value network: no weights at %s", weights_directory() / FILE_NAME)
        return NoValue()
    path = find_weights("vlv", FILE_NAME, Path(weights) if weights is not None else None)
    require_torch()
    from vsnbench.models.vlv.value.weights import read_value_weights

    return LearnedValue(read_value_weights(path), available_device(device))
