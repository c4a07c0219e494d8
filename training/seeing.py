"""Trains the image encoder on single frames to say what is in view, how near it is, and how far the way is free.

Not part of the paper's recipe: the labels are free in a simulator, and with a trained encoder the memory can be
trained on stored features, many times faster than through the images. That is what lets the recipe fit two CPU cores.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from training.networks import Describer, compressed
from training.recipe import Recipe
from training.shards import Shard, mirrored, read_shard
from training.stage import Row, Stage
from training.whole_files import write_whole
from vsnbench.models.pirlnav.network import PIRLNavNetwork

_BATCH = 64


class _Eye(nn.Module):
    def __init__(self, network: PIRLNavNetwork) -> None:
        super().__init__()
        self.network = network
        self.describer = Describer(network.architecture.visual_size)

    def describe(self, images: Tensor) -> Tensor:
        visual: Tensor = self.network.net.visual_fc(compressed(self.network, images.numpy()))
        answer: Tensor = self.describer(visual)
        return answer


def train_seeing(recipe: Recipe, network: PIRLNavNetwork, shards: Sequence[Path], output: Path) -> list[Row]:
    """Train the encoder on the frames of `shards`; the last tenth of them is held out and measured on.

    Returns:
        The log.
    """
    torch.manual_seed(recipe.seed)
    eye = _Eye(network).train()
    loaded = [read_shard(path) for path in shards]
    held_out = max(1, len(loaded) // 10) if len(loaded) > 1 else 0
    training, kept = loaded[held_out:], loaded[:held_out] or loaded
    plan = recipe.seeing
    trained = [*network.net.visual_encoder.parameters(), *network.net.visual_fc.parameters()]
    trained += eye.describer.parameters()
    stage = Stage(
        "seeing",
        output / "seeing.pt",
        recipe.sha256,
        eye,
        trained,
        plan.learning_rate,
        plan.updates,
        recipe.save_every_updates,
    )

    def step(stage: Stage) -> Tensor:
        rng = np.random.default_rng([recipe.seed, 1, stage.update])
        images, labels = _frames(training, plan.batch, rng, mirrored_share=0.5)
        return _error(eye.describe(images), labels)

    def examine(_stage: Stage) -> Row:
        images, labels = _frames(kept, 4 * plan.batch, np.random.default_rng(recipe.seed))
        with torch.no_grad():
            return {"held_out_loss": float(_error(eye.describe(images), labels))}

    stage.run(step, largest_gradient=1.0, examine=examine, examine_every=recipe.save_every_updates)
    network.eval()
    return stage.rows


def store_features(network: PIRLNavNetwork, shard: Path, features: Path) -> None:
    """Write (N, F) float16 compressed features of a shard's frames, unless they are there."""
    if features.is_file():
        return
    frames, rows = read_shard(shard), []
    with torch.no_grad():
        for first in range(0, len(frames), _BATCH):
            batch = np.stack([frames.image(k) for k in range(first, min(first + _BATCH, len(frames)))])
            rows.append(compressed(network, batch).numpy().astype(np.float16))
    write_features(features, np.concatenate(rows))


def write_features(path: Path, features: npt.NDArray[np.float16]) -> None:
    """Write (N, F) features whole or not at all.

    Raises:
        TrainingError: the disk is full or cannot be written.
    """
    write_whole(path, lambda file: np.save(file, features))


def _frames(
    shards: Sequence[Shard], count: int, rng: np.random.Generator, mirrored_share: float = 0.0
) -> tuple[Tensor, Tensor]:
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
    return torch.from_numpy(np.stack(images)), torch.from_numpy(np.stack(labels))


def _error(answer: Tensor, labels: Tensor) -> Tensor:
    return 10 * nn.functional.smooth_l1_loss(answer, labels, beta=0.1)
