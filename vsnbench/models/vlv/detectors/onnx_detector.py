"""A detector from an ONNX file in the form of torchvision's exported Mask R-CNN."""

import ast
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.onnx_session import open_session
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.vlv.detectors.coco import CLASSES_80, CLASSES_91
from vsnbench.models.vlv.detectors.contract import Detection, Detector, Reliability
from vsnbench.models.vlv.detectors.mask_pasting import paste_mask
from vsnbench.text.sanitize import sanitize
from vsnbench.values.observation import Observation, Sensor

_OUTPUTS: Final = ("boxes", "labels", "scores", "masks")
_NAMES_KEY, _TITLE_KEY, _RELIABILITY_KEY = "names", "title", "reliability"
_EDGE_SHARE, _MIDDLE_SHARE = 0.1, 0.3
"""Share of a box at each edge that is not taken for the object, and that is not its middle."""
_FLOOR_M: Final = 0.1
_NEARER_PERCENTILE: Final = 25
_THICKNESS_M: Final = 0.4
"""Largest difference in depth between an object's pixels and the middle of its box."""
_MAX_PX: Final = 1e6
"""Largest plausible coordinate of a box."""


class ONNXDetector(Detector):
    """Runs an ONNX file in onnxruntime.

    The file has one input, float32 (3, H, W) or (1, 3, H, W) in [0, 1], and the outputs boxes (N, 4), labels (N,) and
    scores (N,), optionally masks (N, 1, M, M) within the boxes or over the image; without masks, depth
    finds the object in the box. Its metadata can have `title`, for records and reports; `names`, a
    list of the classes or a mapping from number to name (the default is COCO's 91); and `reliability`, JSON with
    `threshold`, `precision` and `recall` of classes.
    """

    def __init__(self, path: Path, threshold: float, *, threshold_for_all: bool = False) -> None:
        """Load the file.

        The threshold is for classes without one in the file; with `threshold_for_all`, for all classes.

        Raises:
            ModelError: the file is not such a detector.
        """
        # One thread in simulation: the same result on every machine.
        threads = os.environ.get("OMP_NUM_THREADS", "")
        try:
            self._session = open_session(path, int(threads) if threads.isdecimal() else None)
        except Exception as error:  # onnxruntime's errors have no common base class
            reason = str(error).partition("\n")[0][:160]
            raise ModelError(f"{path}: onnxruntime cannot load it ({reason})") from error
        inputs = self._session.get_inputs()
        self._outputs = [output.name for output in self._session.get_outputs()]
        missing = [name for name in _OUTPUTS[:3] if name not in self._outputs]
        if len(inputs) != 1 or missing:
            names = ", ".join(self._outputs) or "none"
            raise ModelError(
                f"{path}: not a detector: it needs one input and the outputs {', '.join(_OUTPUTS[:3])} (and masks); "
                f"it has {len(inputs)} inputs and the outputs {names}"
            )
        self._input = inputs[0]
        metadata = self._session.get_modelmeta().custom_metadata_map
        self._classes = _classes_of(metadata, path)
        self.threshold = threshold
        self._reliability = _reliability_of(metadata, path, threshold if threshold_for_all else None)
        self.kind = "onnx"
        self.name = f"{sanitize(metadata.get(_TITLE_KEY) or 'ONNX detector')[:60]} ({path.name})"
        self.classes = frozenset(self._classes.values())
        has_masks = "masks" in self._outputs
        self.sensors = frozenset({Sensor.RGB} if has_masks else {Sensor.RGB, Sensor.DEPTH})
        self.weights_sha256 = file_sha256(path)
        self.settings: Mapping[str, Any] = {"threshold": threshold, "masks": has_masks}
        if not has_masks:
            self.settings |= {"box_thickness_m": _THICKNESS_M}
        if self._reliability:
            self.settings |= {"thresholds": {name: item.threshold for name, item in self._reliability.items()}}

    def reliability(self, label: str) -> Reliability:
        """Return what the file has about a class, or else the default."""
        return self._reliability.get(label) or super().reliability(label)

    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return the objects above the threshold, best first.

        Raises:
            ModelError: the outputs are invalid.
        """
        height, width = observation.rgb.shape[:2]
        image = np.ascontiguousarray(observation.rgb.transpose(2, 0, 1)).astype(np.float32) / 255
        if len(self._input.shape) == 4:
            image = image[None]
        try:
            answers = self._session.run(self._outputs, {self._input.name: image})
        except Exception as error:
            reason = str(error).partition("\n")[0][:160]
            raise ModelError(f"{self.name}: onnxruntime failed on a {width} x {height} image ({reason})") from error
        found = _checked(dict(zip(self._outputs, answers, strict=True)), self.name)
        detections = []
        for index in np.argsort(-found.scores, kind="stable"):
            label = self._classes.get(int(found.labels[index]))
            if label is None or not found.scores[index] >= self.reliability(label).threshold:
                continue
            left, top, right, bottom = (float(edge) for edge in found.boxes[index])
            edges = (left, top, right, bottom)
            if found.masks is not None:
                mask = found.masks[index]
                over_image = mask.shape == (height, width)
                pixels = mask >= 0.5 if over_image else paste_mask(mask, edges, (height, width))
            else:
                pixels = _object_in(edges, observation)
            detections.append(Detection(label, float(found.scores[index]), edges, pixels))
        return tuple(detections)


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Validated outputs for an image."""

    boxes: npt.NDArray[np.float64]
    """(N, 4) left, top, right, bottom in pixels, finite."""
    labels: npt.NDArray[np.int64]
    scores: npt.NDArray[np.float64]
    masks: npt.NDArray[np.float32] | None
    """(N, M, M) or over the image (N, H, W)."""


def _checked(named: Mapping[str, Any], name: str) -> _Outputs:
    """Validate the outputs."""
    for output in _OUTPUTS[: 4 if "masks" in named else 3]:
        if not isinstance(named[output], np.ndarray) or named[output].dtype.kind not in "fiub":
            raise ModelError(f"{name}: its output {output} is not an array of numbers")
    boxes, labels, scores = (np.asarray(named[output], np.float64) for output in _OUTPUTS[:3])
    boxes = boxes[0] if boxes.ndim == 3 and len(boxes) == 1 else boxes
    labels, scores = labels.reshape(-1), scores.reshape(-1)
    if boxes.ndim != 2 or boxes.shape[1] != 4 or not len(boxes) == len(labels) == len(scores):
        raise ModelError(
            f"{name}: boxes of shape {boxes.shape}, {len(labels)} labels and {len(scores)} scores do not fit together"
        )
    if not (np.abs(boxes) < _MAX_PX).all() or not (np.abs(labels) < _MAX_PX).all():
        raise ModelError(f"{name}: boxes or labels are not finite, or out of range")
    masks = None
    if "masks" in named:
        masks = np.asarray(named["masks"], np.float32)
        if masks.ndim not in (3, 4) or len(masks) != len(boxes) or masks.size != len(boxes) * np.prod(masks.shape[-2:]):
            raise ModelError(f"{name}: masks of shape {masks.shape} for {len(boxes)} boxes")
        if len(boxes) and not masks.size:
            raise ModelError(f"{name}: masks without a pixel")
        masks = masks.reshape(len(boxes), *masks.shape[-2:])
    return _Outputs(boxes, labels.astype(np.int64), scores, masks)


def _object_in(box: tuple[float, float, float, float], observation: Observation) -> npt.NDArray[np.bool_]:
    """Return (H, W): the pixels of a box's object: as far away as the middle of the box, and not floor."""
    inside = _inner(box, _EDGE_SHARE, observation)
    if observation.depth_m is None or not inside.any():
        return inside
    depth_m = observation.depth_m
    rows, columns = np.nonzero(inside)
    height, width = inside.shape
    _, _, up = observation.camera.rays(width, height).points(depth_m[rows, columns], rows, columns)
    solid = np.zeros_like(inside)
    solid[rows, columns] = up > _FLOOR_M
    middle = solid & _inner(box, _MIDDLE_SHARE, observation)
    if not middle.any():
        return solid if solid.any() else inside
    # The nearer part of the middle, because the rest can be a wall behind a chair's legs.
    thing_m = np.percentile(depth_m[middle], _NEARER_PERCENTILE)
    return np.asarray(solid & (np.abs(depth_m - thing_m) < _THICKNESS_M), np.bool_)


def _inner(
    box: tuple[float, float, float, float], edge_share: float, observation: Observation
) -> npt.NDArray[np.bool_]:
    """Return (H, W): the pixels of a box without a share of it at each edge."""
    left, top, right, bottom = box
    side_px, end_px = edge_share * (right - left), edge_share * (bottom - top)
    pixels = np.zeros(observation.rgb.shape[:2], np.bool_)
    rows = slice(max(round(top + end_px), 0), max(round(bottom - end_px), 0))
    columns = slice(max(round(left + side_px), 0), max(round(right - side_px), 0))
    pixels[rows, columns] = True
    return pixels


def _reliability_of(metadata: Mapping[str, str], path: Path, threshold: float | None) -> dict[str, Reliability]:
    """Return the measured reliability of classes; none if the user set a threshold for all classes."""
    text = metadata.get(_RELIABILITY_KEY)
    if text is None or threshold is not None:
        return {}
    try:
        shares = {
            str(name): tuple(float(item[key]) for key in ("threshold", "precision", "recall"))
            for name, item in json.loads(text).items()
        }
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise ModelError(f"{path}: its metadata `{_RELIABILITY_KEY}` cannot be read ({error})") from error
    if not all(0 < share < 1 for item in shares.values() for share in item):
        raise ModelError(f"{path}: its metadata `{_RELIABILITY_KEY}` has a number that is not between 0 and 1")
    return {name: Reliability.measured(*item) for name, item in shares.items()}


def _classes_of(metadata: Mapping[str, str], path: Path) -> dict[int, str]:
    """Return the classes by number."""
    text = metadata.get(_NAMES_KEY)
    if text is None:
        return {number: name for number, name in enumerate(CLASSES_91) if number and name != "N/A"}
    try:
        names = ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:  # all exceptions of literal_eval
        raise ModelError(f"{path}: its metadata `{_NAMES_KEY}` is neither a list nor a mapping") from error
    if isinstance(names, list | tuple):
        names = dict(enumerate(names))
    if not isinstance(names, dict) or not names:
        raise ModelError(f"{path}: its metadata `{_NAMES_KEY}` is neither a list nor a mapping")
    known = {"sofa": "couch", "diningtable": "dining table", "tvmonitor": "tv", "pottedplant": "potted plant"}
    if not all(isinstance(number, int) and isinstance(name, str) for number, name in names.items()):
        raise ModelError(f"{path}: its metadata `{_NAMES_KEY}` is not a mapping from numbers to names")
    found: dict[int, str] = {number: known.get(name) or name for number, name in names.items()}
    if not set(found.values()) & set(CLASSES_80):
        raise ModelError(f"{path}: none of its {len(found)} classes is in COCO")
    return found
