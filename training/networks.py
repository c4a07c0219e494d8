"""The PIRLNav network for training: many frames at once, and the memory over many steps of many lanes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from training.flat_world import View
from training.rollout import INDEX, Lane
from vsnbench.models.checkpoints.residual_network import Bottleneck
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.network import PIRLNavNetwork
from vsnbench.models.pirlnav.policy import GOALS
from vsnbench.values.movement import Action

_IMAGE_MEAN, _IMAGE_VARIANCE = 0.5, 0.06
"""Normalization of images, approximately that of the generated sites."""


def new_network(architecture: Architecture, seed: int) -> PIRLNavNetwork:
    """Return an untrained network; unused actions have a low initial probability."""
    torch.manual_seed(seed)
    network = PIRLNavNetwork(architecture)
    statistics = network.net.visual_encoder.running_mean_and_var
    statistics.get_buffer("_mean").fill_(_IMAGE_MEAN)
    statistics.get_buffer("_var").fill_(_IMAGE_VARIANCE)
    for module in network.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
        if isinstance(module, Bottleneck):  # blocks begin as identities, so that this deep small network trains faster
            nn.init.zeros_(module.bn3.get_parameter("weight"))
    with torch.no_grad():
        head = network.action_distribution.get_parameter("linear.bias")
        head[len(INDEX) :] = -4.0
    for weight in network.net.visual_encoder.parameters():  # this memory layout is faster on processors
        if weight.ndim == 4:
            weight.data = weight.data.contiguous(memory_format=torch.channels_last)
    return network


def compressed(network: PIRLNavNetwork, images: npt.NDArray[np.uint8]) -> Tensor:
    """Return (N, features) of (N, S, S, 3) images, before the visual fully connected layer."""
    scaled = torch.from_numpy(images).to(torch.float32) / 255
    features: Tensor = network.net.visual_encoder(scaled).flatten(1)
    return features


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """Inputs of the network after its encoder, for T steps of B lanes."""

    features: Tensor
    """(T, B, F) compressed features."""
    gps_m: Tensor
    """(T, B, 2)."""
    compass_rad: Tensor
    """(T, B)."""
    goals: Tensor
    """(T, B) int64."""
    previous: Tensor
    """(T, B) int64."""
    begins: Tensor
    """(T, B) bool, first steps of episodes, which reset the memory."""


def recall(network: PIRLNavNetwork, inputs: Inputs, hidden: Tensor) -> tuple[Tensor, Tensor]:
    """Run the memory (layers, B, H) over all steps.

    Returns:
        logits (T, B, actions) and the memory after the last step.
    """
    net = network.net
    steps, lanes = inputs.begins.shape
    visual = net.visual_fc(inputs.features.reshape(steps * lanes, -1)).reshape(steps, lanes, -1)
    direction = torch.stack([torch.cos(inputs.compass_rad), torch.sin(inputs.compass_rad)], dim=-1)
    embedded = torch.cat(
        [
            visual,
            net.gps_embedding(inputs.gps_m),
            net.compass_embedding(direction),
            net.obj_categories_embedding(inputs.goals),
            net.prev_action_embedding(inputs.previous),
        ],
        dim=-1,
    )
    keep = (~inputs.begins).to(hidden.dtype)
    outputs = []
    for step in range(steps):
        output, hidden = net.state_encoder.rnn(embedded[step : step + 1], hidden * keep[step][None, :, None])
        outputs.append(output[0])
    return network.action_distribution(torch.stack(outputs)), hidden


class NetworkStudent:
    """Samples actions of a network for several lanes, with a separate memory for each lane object."""

    def __init__(self, network: PIRLNavNetwork, seed: int) -> None:
        self._network = network.eval()
        self._random = torch.Generator().manual_seed(seed)
        self._memory: dict[int, Tensor] = {}

    @torch.no_grad()
    def choose(self, lanes: Sequence[Lane], views: Sequence[View]) -> tuple[list[Action], npt.NDArray[np.float16]]:
        """Return an action for each lane, and the features of each view."""
        sizes = self._network.architecture
        empty = torch.zeros(sizes.recurrent_layers, sizes.hidden_size)
        hidden = torch.stack([self._memory.get(id(lane), empty) if lane.steps else empty for lane in lanes], dim=1)
        features = compressed(self._network, np.stack([view.rgb for view in views]))
        inputs = Inputs(
            features[None],
            torch.tensor([[lane.gps_m for lane in lanes]], dtype=torch.float32),
            torch.tensor([[lane.compass_rad for lane in lanes]], dtype=torch.float32),
            torch.tensor([[GOALS[lane.goal] for lane in lanes]]),
            torch.tensor([[lane.previous for lane in lanes]]),
            torch.tensor([[lane.steps == 0 for lane in lanes]]),
        )
        logits, hidden = recall(self._network, inputs, hidden)
        for k, lane in enumerate(lanes):
            self._memory[id(lane)] = hidden[:, k]
        shares = torch.softmax(logits[0, :, : len(INDEX)], dim=-1)
        drawn = torch.multinomial(shares, 1, generator=self._random)[:, 0].tolist()
        actions = list(INDEX)
        return [actions[number] for number in drawn], features.numpy().astype(np.float16)


def learning_rate(peak: float, update: int, updates: int) -> float:
    """Return the learning rate of an update: a short warm-up, then half a cosine down to a twentieth."""
    rise = max(1, updates // 50)
    if update < rise:
        return peak * (update + 1) / rise
    done = (update - rise) / max(1, updates - rise)
    return peak * (0.05 + 0.95 * 0.5 * (1 + math.cos(math.pi * done)))
