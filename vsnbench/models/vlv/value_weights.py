"""Reads the value network's released file: `model_state_dict`, checked tensor by tensor before anything is built."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vsnbench.errors import ModelError
from vsnbench.models.pirlnav.checkpoint import CONFIG_CLASSES
from vsnbench.models.safe_checkpoint import load_checkpoint
from vsnbench.models.vlv.goals import VALUE_CLASSES
from vsnbench.models.weights import file_sha256

if TYPE_CHECKING:
    from torch import Tensor

_HEAD: Final = "top.4.weight"
_LANDMARK: Final = "resnet.conv1.weight"
_TWINS: Final = {"0": "conv1", "1": "bn1", "4": "layer1", "5": "layer2", "6": "layer3", "7": "layer4"}
"""The file stores the backbone twice: `features.<number>.*` are the same tensors as `resnet.<name>.*`."""


@dataclass(frozen=True, slots=True, eq=False)
class ValueWeights:
    """What the file holds."""

    path: Path
    sha256: str
    tensors: "Mapping[str, Tensor]"
    """float32, by the file's names; those the network does not use are left out."""


def read_value_weights(path: Path) -> ValueWeights:
    """Read and check the weights of VLV's value network.

    Raises:
        ModelError: the file cannot be read safely, is another model's, or was trained for other classes.
    """
    import torch

    content = load_checkpoint(path, CONFIG_CLASSES)  # so that PIRLNav's can be told by their name
    state = content.get("model_state_dict") if isinstance(content, Mapping) else None
    if not isinstance(state, Mapping):
        raise ModelError(f"{path}: {_what_else(content)}; VLV's value network is vlv_model.torch")
    named: dict[str, Any] = {str(key).removeprefix("module."): tensor for key, tensor in state.items()}
    broken = next((name for name, tensor in named.items() if not isinstance(tensor, torch.Tensor)), None)
    if broken is not None:
        raise ModelError(f"{path}: {broken} is no tensor")
    if _LANDMARK not in named:
        raise ModelError(f"{path}: not VLV's value network: there is no {_LANDMARK} among its {len(named)} tensors")
    return ValueWeights(path, file_sha256(path), _fitting(named, str(path)))


def _fitting(named: "dict[str, Tensor]", origin: str) -> "dict[str, Tensor]":
    """Return the tensors that the network needs; refuse what does not fit it."""
    import torch

    from vsnbench.models.vlv.value_network import ACTIONS, ValueNetwork, names_in_file

    with torch.device("meta"):
        shapes = {names_in_file()[name]: tuple(t.shape) for name, t in ValueNetwork().state_dict().items()}
    missing = sorted(shapes.keys() - named.keys())
    if missing:
        raise ModelError(f"{origin}: {len(missing)} of {len(shapes)} weights are missing, first {missing[0]}")
    outputs = named[_HEAD].shape[0] if named[_HEAD].ndim else 0
    if outputs != len(VALUE_CLASSES) * ACTIONS:
        raise ModelError(
            f"{origin}: trained for other classes: it answers with {outputs} numbers, VLV with "
            f"{len(VALUE_CLASSES)} classes ({', '.join(VALUE_CLASSES)}) x {ACTIONS} actions"
        )
    for name, shape in shapes.items():
        if tuple(named[name].shape) != shape:
            raise ModelError(f"{origin}: {name} has shape {tuple(named[name].shape)}, the network needs {shape}")
    for name, tensor in named.items():
        parts = name.split(".")
        if parts[0] == "features" and parts[1] in _TWINS:
            twin = ".".join(["resnet", _TWINS[parts[1]], *parts[2:]])
            if twin not in named or not torch.equal(named[twin], tensor):
                raise ModelError(f"{origin}: {name} differs from {twin}, which is the same tensor in VLV's network")
    kept = {name: named[name].to(torch.float32 if named[name].is_floating_point() else torch.int64) for name in shapes}
    spoilt = next((name for name, t in kept.items() if not bool(torch.isfinite(t).all())), None)
    if spoilt is not None:
        raise ModelError(f"{origin}: {spoilt} holds NaN or infinite numbers; the file is spoilt")
    return kept


def _what_else(content: object) -> str:
    """Say in words what a checkpoint is that is not the value network's."""
    if isinstance(content, Mapping):
        if "state_dict" in content and "config" in content:
            return "PIRLNav weights"
        if any(str(key).startswith("roi_heads.") for key in content):
            return "the weights of a Mask R-CNN detector (name them with detector_weights in --model-config)"
        return "it has no model_state_dict"
    return f"it holds a {type(content).__name__}"
