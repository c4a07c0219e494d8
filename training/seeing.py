"""Trains the image encoder to predict visible goals, their distance and free distances.

This is not part of the paper's recipe. The simulator provides the labels, and with a trained encoder the memory can be
trained on stored features, many times faster than on images. Two CPU cores are then sufficient.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from training.atomic_files import write_atomic
from training.networks import compressed
from training.recipe import Recipe
from training.shards import LABELS, Shard, mirrored, read_shard
from training.stage import Row, TrainingStage
from vsnbench.models.pirlnav.network import PIRLNavNetwork

_BATCH = 64


class Describer(nn.Module):
    """The network's encoder with a head that predicts image labels, used only to train the encoder."""

    def __init__(self, network: PIRLNavNetwork) -> None:
        super().__init__()
        self.network = network
        self.head = nn.Linear(network.architecture.visual_size, LABELS)

    def forward(self, images: npt.NDArray[np.uint8]) -> Tensor:
        """Return the labels (N, LABELS) of images (N, S, S, 3)."""
        labels: Tensor = self.head(self.network.net.visual_fc(compressed(self.network, images)))
        return labels


def train_seeing(recipe: Recipe, network: PIRLNavNetwork, shards: Sequence[Path], output: Path) -> list[Row]:
    """Train the encoder on the frames of `shards`; the last tenth of the shards is held out for validation.

    Returns:
        The log.
    """
    torch.manual_seed(recipe.seed)
    describer = Describer(network).train()
    loaded = [read_shard(path) for path in shards]
    held_out = max(1, len(loaded) // 10) if len(loaded) > 1 else 0
    training, validation = loaded[held_out:], loaded[:held_out] or loaded
    plan = recipe.seeing
    trained = [*network.net.visual_encoder.parameters(), *network.net.visual_fc.parameters()]
    trained += describer.head.parameters()
    stage = TrainingStage(
        "seeing",
        output / "seeing.pt",
        recipe.sha256,
        describer,
        trained,
        plan.learning_rate,
        plan.updates,
        recipe.save_every_updates,
    )

    def step() -> Tensor:
        rng = np.random.default_rng([recipe.seed, 1, stage.update])
        images, labels = _frames(training, plan.batch, rng, mirrored_share=0.5)
        return _error(describer(images), labels)

    def examine() -> Row:
        images, labels = _frames(validation, 4 * plan.batch, np.random.default_rng(recipe.seed))
        with torch.no_grad():
            return {"held_out_loss": float(_error(describer(images), labels))}

    rows = stage.run(step, 1.0, examine, recipe.save_every_updates)
    network.eval()
    return rows


def store_features(network: PIRLNavNetwork, shard: Path, features: Path) -> None:
    """Write (N, F) float16 compressed features of a shard's frames, unless they exist."""
    if features.is_file():
        return
    frames, rows = read_shard(shard), []
    with torch.no_grad():
        for first in range(0, len(frames), _BATCH):
            batch = np.stack([frames.image(k) for k in range(first, min(first + _BATCH, len(frames)))])
            rows.append(compressed(network, batch).numpy().astype(np.float16))
    write_features(features, np.concatenate(rows))


def write_features(path: Path, features: npt.NDArray[np.float16]) -> None:
    """Write (N, F) features atomically.

    Raises:
        TrainingError: the disk is full or not writable.
    """
    write_atomic(path, lambda file: np.save(file, features))


def _frames(
    shards: Sequence[Shard], count: int, rng: np.random.Generator, mirrored_share: float = 0.0
) -> tuple[npt.NDArray[np.uint8], Tensor]:
    """Return `count` random frames and their labels, some of them mirrored."""
    images, labels = [], []
    for _ in range(count):
        shard = shards[int(rng.integers(len(shards)))]
        k = int(rng.integers(len(shard)))
        image, label = shard.image(k), shard.views[k].astype(np.float32)
        if rng.random() < mirrored_share:
            image, label = mirrored(image, label)
        images.append(image)
        labels.append(label)
    return np.stack(images), torch.from_numpy(np.stack(labels))


def _error(answer: Tensor, labels: Tensor) -> Tensor:
    return 10 * nn.functional.smooth_l1_loss(answer, labels, beta=0.1)
