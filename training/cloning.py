"""Behaviour cloning with inflection weighting: the memory learns the oracle's actions from whole episodes.

As in PIRLNav's first stage. The gradient is truncated every few dozen steps; the memory's state continues through an
episode.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from training.networks import Inputs, recall
from training.recipe import Recipe
from training.shards import UNLABELLED, Shard, inflection_weight, read_shard
from training.stage import Row, TrainingStage
from vsnbench.models.pirlnav.network import PIRLNavNetwork


@dataclass(frozen=True, slots=True)
class Episode:
    """Position of an episode in the data."""

    shard: int
    first: int
    end: int


class Episodes:
    """All episodes of some shards, with the features of their frames."""

    def __init__(self, shards: Sequence[Path], features: Sequence[Path]) -> None:
        self.shards: list[Shard] = [read_shard(path, with_images=False) for path in shards]
        self.features = [np.load(path, mmap_mode="r") for path in features]
        self.weight = inflection_weight(self.shards)
        self.episodes: list[Episode] = []
        for number, shard in enumerate(self.shards):
            firsts = [*np.flatnonzero(shard.begins).tolist(), len(shard)]
            self.episodes += [Episode(number, a, b) for a, b in itertools.pairwise(firsts)]


@dataclass(frozen=True, slots=True, eq=False)
class Batch(Inputs):
    """T steps of B lanes with their targets, (T, B)."""

    expert: Tensor
    weights: Tensor


class Lanes:
    """Endless sequences of random episodes; their positions are the only state."""

    def __init__(self, data: Episodes, seed: Sequence[int], count: int) -> None:
        self._data, self._seed = data, list(seed)
        self.drawn = [0] * count
        self.at = [0] * count

    def take(self, steps: int, least_weight: float) -> Batch:
        """Return the next `steps` of every lane."""
        columns = [self._column(lane, steps) for lane in range(len(self.drawn))]

        def stacked(pick: Callable[[Shard], npt.NDArray[np.generic]], kind: torch.dtype) -> Tensor:
            parts = [
                np.concatenate([pick(self._data.shards[e.shard])[e.first : e.end] for e in column])
                for column in columns
            ]
            return torch.from_numpy(np.stack(parts, axis=1)).to(kind)

        features = [
            np.concatenate([self._data.features[e.shard][e.first : e.end] for e in column]) for column in columns
        ]
        weight = max(self._data.weight, least_weight)
        expert = stacked(lambda shard: shard.expert, torch.int64)
        changes = stacked(lambda shard: shard.inflections, torch.float32)
        return Batch(
            torch.from_numpy(np.stack(features, axis=1).astype(np.float32)),
            stacked(lambda shard: shard.gps_m, torch.float32),
            stacked(lambda shard: shard.compass_rad, torch.float32),
            stacked(lambda shard: shard.goals, torch.int64),
            stacked(lambda shard: shard.previous, torch.int64),
            stacked(lambda shard: shard.begins, torch.bool),
            expert,
            (1 + (weight - 1) * changes) * (expert != UNLABELLED),
        )

    def _column(self, lane: int, steps: int) -> list[Episode]:
        """Return the parts of episodes in a lane's next steps."""
        stretches = []
        while steps > 0:
            rng = np.random.default_rng([*self._seed, lane, self.drawn[lane]])
            episode = self._data.episodes[int(rng.integers(len(self._data.episodes)))]
            first = episode.first + self.at[lane]
            end = min(episode.end, first + steps)
            stretches.append(Episode(episode.shard, first, end))
            steps -= end - first
            self.at[lane] += end - first
            if end == episode.end:
                self.drawn[lane], self.at[lane] = self.drawn[lane] + 1, 0
        return stretches


def train_cloning(
    recipe: Recipe,
    network: PIRLNavNetwork,
    data: Episodes,
    round_number: int,
    output: Path,
    examine: Callable[[], Row],
) -> list[Row]:
    """Train everything except the encoder on the data of all rounds so far.

    Args:
        recipe: sizes and counts.
        network: the network, trained in place.
        data: episodes of this round and earlier ones.
        round_number: 0 for the oracle's demonstrations, then DAgger's rounds.
        output: directory of the run.
        examine: runs validation episodes with the network.

    Returns:
        The log.
    """
    plan, sizes = recipe.cloning, recipe.network
    lanes = Lanes(data, (recipe.seed, 2, round_number), plan.lanes)
    trained = [p for name, p in network.named_parameters() if not name.startswith("net.visual_encoder.")]
    stage = TrainingStage(
        f"cloning-{round_number}",
        output / f"cloning-{round_number}.pt",
        recipe.sha256,
        network,
        trained,
        plan.learning_rate,
        recipe.cloning_updates(round_number),
        recipe.save_every_updates,
    )

    def step() -> Tensor:
        if stage.extra:
            lanes.drawn, lanes.at = list(stage.extra["drawn"]), list(stage.extra["at"])
            hidden = stage.extra["hidden"]
        else:
            hidden = torch.zeros(sizes.recurrent_layers, plan.lanes, sizes.hidden_size)
        batch = lanes.take(plan.steps, plan.least_inflection_weight)
        logits, hidden = recall(network, batch, hidden)
        stage.extra = {"drawn": list(lanes.drawn), "at": list(lanes.at), "hidden": hidden.detach()}
        losses = nn.functional.cross_entropy(
            logits.flatten(0, 1), batch.expert.flatten(), ignore_index=UNLABELLED, reduction="none"
        )
        weights = batch.weights.flatten()
        return (losses * weights).sum() / weights.sum().clamp(min=1)

    return stage.run(step, plan.largest_gradient, examine, recipe.validation.every_updates)
