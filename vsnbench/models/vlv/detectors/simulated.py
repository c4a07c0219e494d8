"""The simulator's own labels as a detector that misses some objects and sees some that are not there.

It is no vision at all and works in simulation only; its name says so in every record and report.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.vlv.detectors.contract import Detection
from vsnbench.models.vlv.goals import CLASS_OF_GOAL
from vsnbench.models.vlv.settings import DetectorKind, VLVSettings
from vsnbench.protocol.observation import InstanceImage, Observation, Sensor

_CLASSES: Final = tuple(sorted([*CLASS_OF_GOAL.values(), "potted plant", "tv"]))
_CLASS_OF_CATEGORY: Final = {**CLASS_OF_GOAL, "plant": "potted plant", "monitor": "tv"}
_LIKELIEST_WRONG: Final = 0.5
"""Chance of a wrong detection at one look, however many are owed."""
_SURE, _UNSURE = (0.70, 0.99), (0.50, 0.85)
"""Ranges of the scores of right and wrong detections: they overlap, as those of real detectors do."""


class SimulatedDetector:
    """Finds a visible object with the recall's chance at each look, and adds wrong detections to the precision."""

    def __init__(self, settings: VLVSettings) -> None:
        """Take recall, precision, range, least area and box error from the settings `simulated_*`."""
        self.kind = DetectorKind.SIMULATED
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
        self._settings = settings
        self.begin(0)

    def begin(self, seed: int) -> None:
        """Start an episode; misses and wrong detections follow from `seed`."""
        self._random = np.random.default_rng(seed)
        self._owed = 0.0

    def detect(self, observation: Observation) -> tuple[Detection, ...]:
        """Return what it finds.

        Raises:
            ModelError: the observation has no instance image; only simulated robots have one.
        """
        image = observation.instances
        if image is None:
            raise ModelError(
                "the simulated detector got no instance image: it works on simulated robots only",
                advice="name real weights, docs/vlv.md says how",
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
                found.append(self._detection(mask, label, _SURE))
        # Wrong detections are owed to the precision and fall due at any look, also where nothing right is to be seen.
        self._owed += len(found) * (1 / self._settings.simulated_precision - 1)
        wrong = []
        if self._random.random() < min(self._owed, _LIKELIEST_WRONG):
            self._owed -= 1
            label = str(self._random.choice(_CLASSES))
            wrong.append(self._detection(self._wrong_place(others, image), label, _UNSURE))
        return tuple(sorted([*found, *wrong], key=lambda detection: -detection.score))

    def _near_and_large(self, mask: npt.NDArray[np.bool_], observation: Observation) -> bool:
        if np.count_nonzero(mask) < self._settings.simulated_min_area * mask.size:
            return False
        if observation.depth_m is None:
            return True
        depth = observation.depth_m[mask]
        depth = depth[np.isfinite(depth)]
        # Nothing but invalid depth is nearer than the camera measures, or lost; near is the likelier.
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

    def _wrong_place(self, others: list[npt.NDArray[np.bool_]], image: InstanceImage) -> npt.NDArray[np.bool_]:
        """Return the pixels of a thing that is no goal, or of a piece of the image where there is none."""
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
