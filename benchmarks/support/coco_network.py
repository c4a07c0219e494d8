"""A COCO detector's ONNX file without VLV's rules: all boxes of an image with a class and a score."""

import ast
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""


@dataclass(frozen=True, slots=True)
class Found:
    """A box of a detector."""

    label: str
    score: float
    box: Box

    def within(self, width: int, height: int) -> "Found":
        """Return the part of the box in the image."""
        left, top, right, bottom = self.box
        box = (max(left, 0.0), max(top, 0.0), min(right, float(width)), min(bottom, float(height)))
        return replace(self, box=box)


class Network:
    """The file in onnxruntime on one thread; outputs as `vsnbench.models.vlv.detectors.onnx_detector` expects them."""

    def __init__(self, path: Path) -> None:
        import onnxruntime as ort

        options = ort.SessionOptions()
        options.intra_op_num_threads = 1
        self._session = ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        metadata = self._session.get_modelmeta().custom_metadata_map
        self.title = metadata.get("title", path.stem)
        self._names = ast.literal_eval(metadata["names"])
        self._reliability = json.loads(metadata.get("reliability", "{}"))

    def threshold(self, label: str) -> float:
        """Return the minimum score of a class that the file states, or else 0.5."""
        return float(self._reliability.get(label, {}).get("threshold", 0.5))

    def find(self, rgb: npt.NDArray[np.uint8], least: float) -> list[Found]:
        """Return the boxes in an image (H, W, 3) with at least a score."""
        image = np.ascontiguousarray(rgb.transpose(2, 0, 1)[None]).astype(np.float32) / 255
        boxes, labels, scores = self._session.run(["boxes", "labels", "scores"], {"image": image})
        return [
            Found(self._names[int(label)], float(score), tuple(map(float, box)))
            for box, label, score in zip(boxes, labels, scores, strict=True)
            if score >= least
        ]


def overlap(one: Box, other: Box) -> float:
    """Return the intersection over union of two boxes."""
    shared = shared_area(one, other)
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (one, other)]
    return shared / (sum(areas) - shared)


def shared_area(one: Box, other: Box) -> float:
    """Return the area of the intersection of two boxes."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    return max(width, 0) * max(height, 0)
