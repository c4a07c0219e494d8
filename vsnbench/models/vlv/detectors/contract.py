"""What every detector is: an image in, boxes with classes, scores and masks out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.settings import DetectorKind
from vsnbench.protocol.observation import Observation, Sensor


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """One object found in an image."""

    label: str
    """In COCO's words."""
    score: float
    box: tuple[float, float, float, float]
    """left, top, right, bottom in pixels."""
    mask: npt.NDArray[np.bool_]
    """(H, W): the pixels that show it."""


class Detector(Protocol):
    """Finds objects in what a camera sees."""

    kind: DetectorKind
    """Never `auto`."""
    name: str
    """What it is, in words, for every record and report."""
    classes: frozenset[str]
    """The classes it can find, in COCO's words."""
    sensors: frozenset[Sensor]
    """What it needs."""
    weights_sha256: str
    """Of its weights; empty without any."""
    settings: Mapping[str, Any]
    """JSON-serialisable."""

    def begin(self, seed: int) -> None:
        """Start an episode; whatever is random in it follows from `seed`."""
        ...

    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return what is seen, best score first."""
        ...
