"""The PIRLNav network in PyTorch: ResNet-50 with group norm, compression, GRU, action head and optional critic.

Module names follow the authors' checkpoints, so that a state dict without its prefix fits as it is.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from vsnbench.models.checkpoints.residual_network import Bottleneck, ResidualNetwork
from vsnbench.models.pirlnav.architecture import COMPASS_SIZE, EMBEDDING_SIZE, GPS_SIZE, Architecture
from vsnbench.models.pirlnav.onnx_graph import VARIANCE_FLOOR, Weights
from vsnbench.models.pirlnav.weight_shapes import BLOCKS


class RunningMeanAndVar(nn.Module):
    """Normalisation with the statistics of training. The configuration's switch had no effect."""

    _mean: Tensor
    _var: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("_mean", torch.zeros(1, 3, 1, 1))
        self.register_buffer("_var", torch.zeros(1, 3, 1, 1))
        self.register_buffer("_count", torch.zeros(()))

    def forward(self, x: Tensor) -> Tensor:
        """Return the normalised image; the variance has a minimum."""
        return (x - self._mean) / torch.sqrt(torch.clamp(self._var, min=VARIANCE_FLOOR))


class VisualEncoder(nn.Module):
    """Image to compressed feature map."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        planes = architecture.base_planes
        self.running_mean_and_var = RunningMeanAndVar()
        # Group norm instead of batch norm; the groups are half the base planes in every layer.
        self.backbone = ResidualNetwork(Bottleneck, BLOCKS, partial(nn.GroupNorm, planes // 2), planes)
        channels = planes * 2 ** (len(BLOCKS) - 1) * Bottleneck.expansion
        self.compression = nn.Sequential(
            nn.Conv2d(channels, architecture.compressed_channels, 3, padding=1, bias=False),
            nn.GroupNorm(1, architecture.compressed_channels),
            nn.ReLU(),
        )

    def forward(self, image: Tensor) -> Tensor:
        """Return (1, C, S / 32, S / 32) features of a (1, S, S, 3) image in [0, 1]."""
        x = self.running_mean_and_var(image.permute(0, 3, 1, 2))
        features: Tensor = self.compression(self.backbone(x.to(self.backbone.conv1.weight.dtype))[-1])
        return features


class StateEncoder(nn.Module):
    """The memory of the episode."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        self.rnn = nn.GRU(architecture.recurrent_input_size, architecture.hidden_size, architecture.recurrent_layers)


class Net(nn.Module):
    """Encoders of all inputs, and the GRU."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        flat = architecture.compressed_channels * architecture.final_grid_px**2
        self.visual_encoder = VisualEncoder(architecture)
        self.visual_fc = nn.Sequential(nn.Flatten(), nn.Linear(flat, architecture.visual_size), nn.ReLU())
        self.gps_embedding = nn.Linear(GPS_SIZE, EMBEDDING_SIZE)
        self.compass_embedding = nn.Linear(COMPASS_SIZE, EMBEDDING_SIZE)
        self.obj_categories_embedding = nn.Embedding(architecture.goals, EMBEDDING_SIZE)
        self.prev_action_embedding = nn.Embedding(architecture.actions + 1, EMBEDDING_SIZE)
        self.state_encoder = StateEncoder(architecture)


class _Linear(nn.Module):
    """A linear layer under the attribute name that the checkpoints use for it."""

    def __init__(self, attribute: str, inputs: int, outputs: int) -> None:
        super().__init__()
        self.add_module(attribute, nn.Linear(inputs, outputs))

    def forward(self, x: Tensor) -> Tensor:
        for layer in self.children():
            x = layer(x)
        return x


class PIRLNavNetwork(nn.Module):
    """The network for one robot and single steps."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        self.architecture = architecture
        self.net = Net(architecture)
        self.action_distribution = _Linear("linear", architecture.hidden_size, architecture.actions)
        self.critic = _Linear("fc", architecture.hidden_size, 1) if architecture.critic else None

    def forward(
        self, image: Tensor, gps: Tensor, compass: Tensor, goal: Tensor, previous: Tensor, mask: Tensor, hidden: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Run one step.

        Args:
            image: (1, S, S, 3) float in [0, 1].
            gps: (1, 2) float32, metres forward and RIGHT of the episode's start.
            compass: (1, 1) float32, radians counter-clockwise from the episode's start.
            goal: (1,) int64 goal category.
            previous: (1,) int64: 1 + the previous action, 0 at the start of an episode.
            mask: (1, 1) float32: 0 at the start of an episode, else 1.
            hidden: (layers, 1, hidden) float32.

        Returns:
            (1, actions) logits; (1, 1) value, NaN without a critic; (layers, 1, hidden) state after the step.
        """
        net = self.net
        visual = net.visual_fc(net.visual_encoder(image)).to(hidden.dtype)
        direction = torch.cat([torch.cos(compass), torch.sin(compass)], dim=1)
        inputs = torch.cat(
            [
                visual,
                net.gps_embedding(gps),
                net.compass_embedding(direction),
                net.obj_categories_embedding(goal),
                net.prev_action_embedding(previous),
            ],
            dim=1,
        )
        features, after = net.state_encoder.rnn(inputs[None], hidden * mask[None])
        features = features[0]
        logits = self.action_distribution(features)
        value = self.critic(features) if self.critic is not None else torch.full_like(mask, torch.nan)
        return logits, value, after


class _Undrawn(TorchFunctionMode):
    """Skips the random initialization of embeddings, which would load PyTorch's compiler for 2.5 s."""

    def __torch_function__(
        self, function: Callable[..., Any], _types: Any, arguments: Any = (), options: Mapping[str, Any] | None = None
    ) -> Any:
        named = options or {}
        if function is nn.init.normal_:
            return [*arguments, *named.values()][0]  # the tensor to initialize
        return function(*arguments, **named)


def build_network(architecture: Architecture, weights: Weights) -> PIRLNavNetwork:
    """Return the network in evaluation mode on the CPU, with its own copy of weights that match `expected_shapes`."""
    with torch.device("meta"), _Undrawn():
        network = PIRLNavNetwork(architecture)
    network.load_state_dict({name: torch.tensor(weight) for name, weight in weights.items()}, assign=True)
    return network.requires_grad_(requires_grad=False).eval()
