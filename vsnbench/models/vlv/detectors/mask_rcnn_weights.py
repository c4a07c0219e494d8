"""Reads Mask R-CNN weights in torchvision's layout: the released COCO file, or files of later versions."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.safe_checkpoint import load_checkpoint
from vsnbench.models.checkpoints.state_dict import fitting_weights
from vsnbench.models.vlv.detectors.coco import CLASSES_91

if TYPE_CHECKING:
    from torch import Tensor

_HEAD: Final = "roi_heads.box_predictor.cls_score.weight"
_OLDER_NAMES: Final = (
    (re.compile(r"^(backbone\.fpn\.(?:inner|layer)_blocks\.\d)\.(weight|bias)$"), r"\1.0.\2"),
    (re.compile(r"^(rpn\.head\.conv)\.(weight|bias)$"), r"\1.0.0.\2"),
)
_OLDER_MASK: Final = re.compile(r"^roi_heads\.mask_head\.mask_fcn(\d)\.(weight|bias)$")


def read_mask_rcnn_weights(path: Path) -> "dict[str, Tensor]":
    """Return the checked weights of a Mask R-CNN R50-FPN for COCO, by the names of `MaskRCNN`.

    Raises:
        ModelError: the file cannot be read safely, is another model's, or was trained for other classes.
    """
    import torch

    from vsnbench.models.vlv.detectors.mask_rcnn_network import MaskRCNN

    content: Any = load_checkpoint(path)
    if isinstance(content, Mapping) and isinstance(content.get("model"), Mapping):
        content = content["model"]  # the format of torchvision's training scripts
    if not isinstance(content, Mapping):
        raise ModelError(f"{path}: not a detector's weights: it contains a {type(content).__name__}")
    if "model_state_dict" in content:
        raise ModelError(f"{path}: VLV's value network, not a detector", advice="name it with --weights")
    named = {_newest(str(key)): tensor for key, tensor in content.items() if not str(key).endswith("batches_tracked")}
    if _HEAD not in named or not all(isinstance(tensor, np.ndarray) for tensor in named.values()):
        raise ModelError(f"{path}: not the weights of a Mask R-CNN: {_HEAD} is missing among its {len(named)} keys")
    found = int(named[_HEAD].shape[0]) if named[_HEAD].ndim else 0
    if found != len(CLASSES_91):
        raise ModelError(f"{path}: trained for {found} classes including the background, COCO has {len(CLASSES_91)}")
    with torch.device("meta"):
        shapes = {name: tuple(tensor.shape) for name, tensor in MaskRCNN(found).state_dict().items()}
    return {name: torch.from_numpy(weight) for name, weight in fitting_weights(named, shapes, str(path)).items()}


def _newest(name: str) -> str:
    """Return torchvision's newest name of a tensor."""
    for older, newer in _OLDER_NAMES:
        name = older.sub(newer, name)
    return _OLDER_MASK.sub(lambda match: f"roi_heads.mask_head.{int(match[1]) - 1}.0.{match[2]}", name)
