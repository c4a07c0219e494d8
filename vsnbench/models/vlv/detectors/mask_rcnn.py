"""The paper's detector: Mask R-CNN R50-FPN with COCO's classes, from weights in torchvision's layout."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.vlv.detectors.coco import CLASSES_80, CLASSES_91
from vsnbench.models.vlv.detectors.contract import Detection, Detector
from vsnbench.models.vlv.detectors.mask_pasting import paste_mask
from vsnbench.models.vlv.detectors.mask_rcnn_network import MaskRCNN, Objects
from vsnbench.models.vlv.detectors.mask_rcnn_weights import read_mask_rcnn_weights
from vsnbench.models.vlv.settings import DetectorKind
from vsnbench.values.observation import Observation, Sensor


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
        self.kind = DetectorKind.MASK_RCNN
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
