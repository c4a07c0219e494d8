"""Interface of detectors: from an image to boxes with classes, scores and masks."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.settings import DetectorKind
from vsnbench.values.observation import Observation, Sensor


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """One object found in an image."""

    label: str
    """Class in COCO."""
    score: float
    box: tuple[float, float, float, float]
    """left, top, right, bottom in pixels."""
    mask: npt.NDArray[np.bool_]
    """(H, W): pixels of the object."""


class Detector(ABC):
    """Detects objects in camera images."""

    kind: DetectorKind
    """Never `auto`."""
    name: str
    """Description for records and reports."""
    classes: frozenset[str]
    """COCO classes that it can detect."""
    sensors: frozenset[Sensor]
    """Sensors that it needs."""
    weights_sha256: str
    """Hash of its weights; empty without weights."""
    settings: Mapping[str, Any]
    """JSON-serializable."""

    def begin(self, seed: int) -> None:
        """Start an episode. All randomness follows from `seed`. Does nothing by default."""

    @abstractmethod
    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return the detected objects, best score first."""
