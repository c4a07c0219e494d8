"""A simulated detector: the simulator's labels with misses and false detections.

It uses no vision and works only in simulation. Its name shows this in records and reports.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.vlv.detectors.contract import Detection, Detector
from vsnbench.models.vlv.goals import CLASS_OF_GOAL
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.observation import InstanceImage, Observation, Sensor

_CLASSES: Final = tuple(sorted([*CLASS_OF_GOAL.values(), "potted plant", "tv"]))
_CLASS_OF_CATEGORY: Final = {**CLASS_OF_GOAL, "plant": "potted plant", "monitor": "tv"}
_MAX_FALSE_RATE: Final = 0.5
"""Maximum probability of a false detection in an observation."""
_TRUE_SCORES, _FALSE_SCORES = (0.70, 0.99), (0.50, 0.85)
"""Ranges of the scores of true and false detections, which overlap as for real detectors."""


class SimulatedDetector(Detector):
    """Detects visible objects with the probability of the recall, and adds false detections to meet the precision."""

    def __init__(self, settings: VLVSettings) -> None:
        """Read recall, precision, range, minimum area and box error from the settings `simulated_*`."""
        self.kind = "simulated"
        self.name = (
            f"simulated detector: recall {settings.simulated_recall:g}, "
            f"precision {settings.simulated_precision:g}, range {settings.simulated_range_m:g} m"
        )
        self.classes = frozenset(_CLASSES)
        self.sensors = frozenset({Sensor.INSTANCES, Sensor.DEPTH})
        self.weights_sha256 = ""
        self.settings: Mapping[str, Any] = {
            name: value for name, value in settings.model_dump(mode="json").items() if name.startswith("simulated_")
        }
        self.threshold = settings.detector_threshold
        self._settings = settings
        self.begin(0)

    def begin(self, seed: int) -> None:
        """Start an episode. Misses and false detections follow from `seed`."""
        self._random = np.random.default_rng(seed)
        self._false_debt = 0.0

    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return the detected objects.

        Raises:
            ModelError: the observation has no instance image, which only simulated robots have.
        """
        image = observation.instances
        if image is None:
            raise ModelError(
                "the simulated detector needs an instance image: it works on simulated robots only",
                advice="get a detector: `vsnbench models fetch mask-rcnn`, or export one (docs/vlv.md)",
            )
        found: list[Detection] = []
        others: list[npt.NDArray[np.bool_]] = []
        for instance, category in _visible(image):
            mask = image.ids == instance
            label = _CLASS_OF_CATEGORY.get(category)
            if not self._near_and_large(mask, observation):
                continue
            if label is None:
                others.append(mask)
            elif self._random.random() < self._settings.simulated_recall:
                found.append(self._detection(mask, label, _TRUE_SCORES))
        # True detections accumulate a debt of false ones, which can be paid in any observation.
        self._false_debt += len(found) * (1 / self._settings.simulated_precision - 1)
        false = []
        if self._random.random() < min(self._false_debt, _MAX_FALSE_RATE):
            self._false_debt -= 1
            label = str(self._random.choice(_CLASSES))
            false.append(self._detection(self._false_mask(others, image), label, _FALSE_SCORES))
        return tuple(sorted([*found, *false], key=lambda detection: -detection.score))

    def _near_and_large(self, mask: npt.NDArray[np.bool_], observation: Observation) -> bool:
        if np.count_nonzero(mask) < self._settings.simulated_min_area * mask.size:
            return False
        if observation.depth_m is None:
            return True
        depth = observation.depth_m[mask]
        depth = depth[np.isfinite(depth)]
        # An object with only invalid depth is probably nearer than the camera's range.
        return depth.size == 0 or float(np.median(depth)) <= self._settings.simulated_range_m

    def _detection(self, mask: npt.NDArray[np.bool_], label: str, scores: tuple[float, float]) -> Detection:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        height, width = mask.shape
        left, right = float(columns[0]), float(columns[-1] + 1)
        top, bottom = float(rows[0]), float(rows[-1] + 1)
        error = self._random.normal(0.0, self._settings.simulated_box_error, 4)
        box = (
            float(np.clip(left + error[0] * (right - left), 0, width - 1)),
            float(np.clip(top + error[1] * (bottom - top), 0, height - 1)),
            float(np.clip(right + error[2] * (right - left), 1, width)),
            float(np.clip(bottom + error[3] * (bottom - top), 1, height)),
        )
        return Detection(label, float(self._random.uniform(*scores)), box, mask)

    def _false_mask(self, others: list[npt.NDArray[np.bool_]], image: InstanceImage) -> npt.NDArray[np.bool_]:
        """Return the mask of another object, or of a random part of the image if there is none."""
        if others:
            return others[int(self._random.integers(len(others)))]
        height, width = image.ids.shape
        mask = np.zeros((height, width), np.bool_)
        top, left = int(self._random.integers(height * 3 // 4)), int(self._random.integers(width * 3 // 4))
        mask[top : top + height // 4, left : left + width // 4] = True
        return mask


def _visible(image: InstanceImage) -> list[tuple[int, str]]:
    """Return the instances in the image with their categories, by number."""
    present = np.flatnonzero(np.bincount(image.ids.ravel().clip(min=0)))
    return [(int(k), image.categories[int(k)]) for k in present if int(k) in image.categories]
