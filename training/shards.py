"""Training data of one site: network inputs, the oracle's actions, and image labels."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from training.atomic_files import TrainingError, write_atomic
from vsnbench.models.pirlnav.policy import GOALS

BANDS: Final = 6
"""Number of vertical strips of the depth image, for the free distance."""
STRIPS: Final = 5
"""Number of vertical strips of the image, for the goals."""
LABELS: Final = (STRIPS + 1) * len(GOALS) + BANDS
UNLABELLED: Final = -1


@dataclass(frozen=True, slots=True, eq=False)
class Shard:
    """N steps of consecutive whole episodes."""

    images: npt.NDArray[np.uint8]
    """All JPEG files, concatenated."""
    ends: npt.NDArray[np.int64]
    """(N,) end of each file."""
    views: npt.NDArray[np.float16]
    """(N, LABELS): for each goal the share (square root) of each strip, left to right; nearness of each goal
    (1 / (1 + metres), 0 if not visible); and nearness of the surface ahead in each band.
    """
    gps_m: npt.NDArray[np.float32]
    """(N, 2) forward and right of the episode's start."""
    compass_rad: npt.NDArray[np.float32]
    """(N,)."""
    goals: npt.NDArray[np.uint8]
    """(N,)."""
    previous: npt.NDArray[np.uint8]
    """(N,) 1 + the previous action, 0 at the start of an episode."""
    expert: npt.NDArray[np.int8]
    """(N,) the oracle's action, `UNLABELLED` without a path."""
    begins: npt.NDArray[np.bool_]
    """(N,) first step of an episode."""

    def __len__(self) -> int:
        return len(self.ends)

    def image(self, index: int) -> npt.NDArray[np.uint8]:
        """Return one frame, (S, S, 3) RGB."""
        begin = int(self.ends[index - 1]) if index else 0
        decoded = cv2.imdecode(self.images[begin : int(self.ends[index])], cv2.IMREAD_COLOR)
        return np.ascontiguousarray(np.asarray(decoded, np.uint8)[..., ::-1])

    @property
    def inflections(self) -> npt.NDArray[np.bool_]:
        """(N,) whether the oracle's action differs from the previous one; a first step counts."""
        return np.asarray(self.previous != self.expert.astype(np.int64) + 1, np.bool_)


def mirrored(
    image: npt.NDArray[np.uint8], labels: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Return an image (S, S, 3) and its labels, mirrored."""
    goals = len(GOALS)
    shares, near, ahead = np.split(labels, [STRIPS * goals, (STRIPS + 1) * goals])
    turned = shares.reshape(goals, STRIPS)[:, ::-1].ravel()
    return image[:, ::-1], np.concatenate([turned, near, ahead[::-1]])


def encode(rgb: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    """Return an image as JPEG."""
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(rgb[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(data, np.uint8)


def write_shard(path: Path, shard: Shard, provenance: dict[str, Any]) -> None:
    """Write a shard atomically.

    Raises:
        TrainingError: the disk is full or not writable.
    """
    arrays = {field.name: getattr(shard, field.name) for field in fields(Shard)}
    text = np.frombuffer(json.dumps(provenance, sort_keys=True).encode(), np.uint8)
    write_atomic(path, lambda file: np.savez(file, provenance=text, **arrays))


def read_shard(path: Path, *, with_images: bool = True) -> Shard:
    """Read a shard, optionally without its images, which take most of the memory.

    Raises:
        TrainingError: the file is damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            names = [field.name for field in fields(Shard) if with_images or field.name != "images"]
            arrays = {name: archive[name] for name in names}
            return Shard(**{"images": np.zeros(0, np.uint8)} | arrays)
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise TrainingError(f"shard {path} is damaged ({error}): remove it and run the same command again") from error


def inflection_weight(shards: Iterable[Shard]) -> float:
    """Return the ratio of all steps to those at which the oracle changes its action."""
    counted = [
        (int((s.expert != UNLABELLED).sum()), int((s.inflections & (s.expert != UNLABELLED)).sum())) for s in shards
    ]
    return sum(steps for steps, _ in counted) / max(1, sum(changes for _, changes in counted))
