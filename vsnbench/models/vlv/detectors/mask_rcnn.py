"""The paper's detector: Mask R-CNN R50-FPN with COCO's classes.

Its weights are in torchvision's layout: the released COCO file, or files of later versions.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.safe_checkpoint import load_checkpoint
from vsnbench.models.checkpoints.state_dict import fitting_weights
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.vlv.detectors.coco import CLASSES_80, CLASSES_91
from vsnbench.models.vlv.detectors.contract import Detection, Detector
from vsnbench.models.vlv.detectors.mask_pasting import paste_mask
from vsnbench.models.vlv.detectors.mask_rcnn_network import MaskRCNN, Objects
from vsnbench.values.observation import Observation, Sensor

_HEAD: Final = "roi_heads.box_predictor.cls_score.weight"
_OLDER_NAMES: Final = (
    (re.compile(r"^(backbone\.fpn\.(?:inner|layer)_blocks\.\d)\.(weight|bias)$"), r"\1.0.\2"),
    (re.compile(r"^(rpn\.head\.conv)\.(weight|bias)$"), r"\1.0.0.\2"),
)
_OLDER_MASK: Final = re.compile(r"^roi_heads\.mask_head\.mask_fcn(\d)\.(weight|bias)$")


class MaskRCNNDetector(Detector):
    """Runs the network on the camera's image."""

    def __init__(self, path: Path, device: str, threshold: float) -> None:
        """Load the weights.

        Raises:
            ModelError: the weights cannot be used.
        """
        weights = read_mask_rcnn_weights(path)
        self._network = MaskRCNN(len(CLASSES_91))
        self._network.load_state_dict(weights)
        self._network.eval().to(device)
        self.kind = "mask_rcnn"
        self.name = f"Mask R-CNN R50-FPN ({path.name})"
        self.classes = frozenset(CLASSES_80)
        self.sensors = frozenset({Sensor.RGB})
        self.weights_sha256 = file_sha256(path)
        self.settings: Mapping[str, Any] = {"device": device, "threshold": threshold}
        self.threshold = threshold
        self.device = device

    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return the objects above the threshold, best first."""
        height, width = observation.rgb.shape[:2]
        return self.detections(self.run(observation), (height, width))

    def detections(self, found: Objects, image: tuple[int, int]) -> tuple[Detection, ...]:
        """Return the objects above the threshold, with masks for an image of (height, width)."""
        detections = []
        for box, label, score, mask in zip(
            found.boxes.tolist(), found.labels.tolist(), found.scores.tolist(), found.masks.cpu().numpy(), strict=True
        ):
            if score < self.threshold:
                continue
            edges = (box[0], box[1], box[2], box[3])
            detections.append(Detection(CLASSES_91[label], score, edges, paste_mask(np.asarray(mask), edges, image)))
        return tuple(detections)

    @torch.inference_mode()
    def run(self, observation: Observation) -> Objects:
        """Return all objects that the network found."""
        image = torch.from_numpy(np.ascontiguousarray(observation.rgb.transpose(2, 0, 1))).to(self.device)
        objects: Objects = self._network(image.to(torch.float32) / 255)
        return objects


def read_mask_rcnn_weights(path: Path) -> dict[str, torch.Tensor]:
    """Return the checked weights of a Mask R-CNN R50-FPN for COCO, by the names of `MaskRCNN`.

    Raises:
        ModelError: the file cannot be read safely, is another model's, or was trained for other classes.
    """
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
