"""Interface of detectors: from an image to boxes with classes, scores and masks."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.settings import DetectorKind
from vsnbench.values.observation import Observation, Sensor

_MAX_DOUBT: Final = 0.05
"""Probability of a wrong place that the views of a measured detector must reach."""


@dataclass(frozen=True, slots=True)
class Reliability:
    """How much the detections of a class prove."""

    threshold: float
    """Minimum score of a detection."""
    views_to_believe: int = 2
    """Number of views that must show the goal at a place."""
    miss_weight: float = 1.0
    """Weight of a view without the expected detection, if a view with it has weight 1."""
    is_measured: bool = False
    """Whether precision and recall are measured. The robot then stops at a place that enough views support, because a
    weak detector often misses an object that fills the image."""

    @classmethod
    def measured(cls, threshold: float, precision: float, recall: float) -> "Reliability":
        """Return the reliability of a class whose precision and recall in single views are known."""
        views = math.ceil(math.log(_MAX_DOUBT) / math.log(1 - precision))
        return cls(threshold, max(views, 2), min(recall / (1 - recall) / 2, 1.0), is_measured=True)


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
    threshold: float
    """Minimum score of a detection, for classes whose reliability is not measured."""
    device: str = "cpu"
    """Device of its network, such as `cpu` or `cuda`."""

    def begin(self, seed: int) -> None:
        """Start an episode. All randomness follows from `seed`. Does nothing by default."""

    def reliability(self, label: str) -> Reliability:  # noqa: ARG002 - the same for all classes by default
        """Return how much the detections of a class prove."""
        return Reliability(self.threshold)

    @abstractmethod
    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return the detected objects, best score first."""
