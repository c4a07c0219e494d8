"""Opens the detector of the settings; `auto` chooses by the available files."""

import logging
from functools import cache
from pathlib import Path
from typing import Final

from vsnbench.errors import ModelError
from vsnbench.files.home import expanded
from vsnbench.models.checkpoints.torch_runtime import available_device, require_torch
from vsnbench.models.checkpoints.weights import find_weights, weights_directory
from vsnbench.models.vlv.detectors.contract import Detector
from vsnbench.models.vlv.detectors.simulated import SimulatedDetector
from vsnbench.models.vlv.settings import DetectorKind, VLVSettings

logger = logging.getLogger(__name__)

MASK_RCNN_FILE: Final = "vlv_mask_rcnn.pth"
ONNX_FILE: Final = "vlv_detector.onnx"


def open_detector(settings: VLVSettings, device: str) -> Detector:
    """Return the detector.

    Raises:
        ModelError: its file is missing or cannot be used.
    """
    kind = _resolved(settings)
    given = expanded(settings.detector_weights) if settings.detector_weights else None
    if kind == "simulated":
        if given is not None:
            raise ModelError("the simulated detector has no weights", advice=f"leave out detector_weights ({given})")
        return SimulatedDetector(settings)
    if given is not None and not given.is_file():
        raise ModelError(
            f"no detector at {given} (detector_weights)",
            advice="write detector_weights as an absolute path, or relative to the working directory",
        )
    if kind == "onnx":
        from vsnbench.models.vlv.detectors.onnx_detector import ONNXDetector

        is_chosen = "detector_threshold" in settings.model_fields_set
        return ONNXDetector(_file(given, ONNX_FILE), settings.detector_threshold, threshold_for_all=is_chosen)
    require_torch()
    from vsnbench.models.vlv.detectors.mask_rcnn import MaskRCNNDetector

    return MaskRCNNDetector(_file(given, MASK_RCNN_FILE), available_device(device), settings.detector_threshold)


def _resolved(settings: VLVSettings) -> DetectorKind:
    """Return the kind of detector, with `auto` resolved."""
    if settings.detector != "auto":
        return settings.detector
    if settings.detector_weights:
        return "onnx" if settings.detector_weights.endswith(".onnx") else "mask_rcnn"
    if (weights_directory() / MASK_RCNN_FILE).is_file():
        return "mask_rcnn"
    if (weights_directory() / ONNX_FILE).is_file():
        return "onnx"
    _warn_without_weights(weights_directory())
    return "simulated"


@cache
def _warn_without_weights(directory: Path) -> None:
    """Say once in a process that no detector has weights; a sweep opens a model for every condition."""
    logger.warning(
        "no weights of a detector (%s or %s in %s): the simulator's labels are used, which only simulated robots have; "
        "`vsnbench models fetch mask-rcnn` gets a detector, and docs/vlv.md shows how to export one",
        MASK_RCNN_FILE,
        ONNX_FILE,
        directory,
    )


def _file(given: Path | None, name: str) -> Path:
    return given if given is not None else find_weights("the detector", name, None)
