"""Reads the released file of the value network, and checks every tensor."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.safe_checkpoint import load_checkpoint
from vsnbench.models.checkpoints.state_dict import fitting_weights, only_tensors
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.pirlnav.checkpoint import CONFIG_CLASSES
from vsnbench.models.vlv.goals import VALUE_CLASSES
from vsnbench.models.vlv.value.network import ACTIONS, ValueNetwork, names_in_file

_HEAD: Final = "top.4.weight"
_LANDMARK: Final = "resnet.conv1.weight"
_DUPLICATES: Final = {"0": "conv1", "1": "bn1", "4": "layer1", "5": "layer2", "6": "layer3", "7": "layer4"}
"""The file stores the backbone twice: `features.<number>.*` are the same tensors as `resnet.<name>.*`."""


@dataclass(frozen=True, slots=True, eq=False)
class ValueWeights:
    """Contents of the file."""

    path: Path
    sha256: str
    tensors: Mapping[str, Tensor]
    """float32 tensors of the network, by their names in the file."""


def read_value_weights(path: Path) -> ValueWeights:
    """Read and check the weights of VLV's value network.

    Raises:
        ModelError: the file cannot be read safely, is another model's, or was trained for other classes.
    """
    content = load_checkpoint(path, CONFIG_CLASSES)  # to recognise PIRLNav's weights
    state = content.get("model_state_dict") if isinstance(content, Mapping) else None
    if not isinstance(state, Mapping):
        raise ModelError(f"{path}: {_describe_content(content)}; VLV's value network is vlv_model.torch")
    named = only_tensors({str(key).removeprefix("module."): tensor for key, tensor in state.items()}, str(path))
    if _LANDMARK not in named:
        raise ModelError(f"{path}: not VLV's value network: {_LANDMARK} is missing among its {len(named)} tensors")
    return ValueWeights(path, file_sha256(path), _fitting(named, str(path)))


def _fitting(named: Mapping[str, npt.NDArray[Any]], origin: str) -> dict[str, Tensor]:
    """Return the tensors that the network needs, and check their shapes."""
    in_file = names_in_file()
    with torch.device("meta"):
        shapes = {in_file[name]: tuple(tensor.shape) for name, tensor in ValueNetwork().state_dict().items()}
    head = named.get(_HEAD)
    outputs = head.shape[0] if head is not None and head.ndim else 0
    if head is not None and outputs != len(VALUE_CLASSES) * ACTIONS:
        raise ModelError(
            f"{origin}: trained for other classes: it has {outputs} numbers as output, VLV has "
            f"{len(VALUE_CLASSES)} classes ({', '.join(VALUE_CLASSES)}) x {ACTIONS} actions"
        )
    weights = fitting_weights(named, shapes, origin, surplus_allowed=True)
    for name, tensor in named.items():
        first, _, rest = name.partition(".")
        layer, _, inner = rest.partition(".")
        if first == "features" and layer in _DUPLICATES:
            duplicate = ".".join(filter(None, ["resnet", _DUPLICATES[layer], inner]))
            if duplicate not in named or not np.array_equal(named[duplicate], tensor):
                raise ModelError(
                    f"{origin}: {name} differs from {duplicate}, which is the same tensor in VLV's network"
                )
    return {name: torch.from_numpy(weight) for name, weight in weights.items()}


def _describe_content(content: object) -> str:
    """Return what a checkpoint contains instead of the value network."""
    if isinstance(content, Mapping):
        if "state_dict" in content and "config" in content:
            return "PIRLNav weights"
        if any(str(key).startswith("roi_heads.") for key in content):
            return "the weights of a Mask R-CNN detector (name them with detector_weights in --model-config)"
        return "it has no model_state_dict"
    return f"it contains a {type(content).__name__}"
