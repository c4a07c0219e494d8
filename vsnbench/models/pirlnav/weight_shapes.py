"""Names and shapes of a checkpoint's weights, from the network's sizes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from vsnbench.models.pirlnav.architecture import COMPASS_SIZE, EMBEDDING_SIZE, GPS_SIZE, Architecture

_EXPANSION: Final = 4
"""Ratio of the channels after and inside a block."""
BLOCKS: Final = (3, 4, 6, 3)
"""Blocks of each layer of the ResNet-50."""
ENCODER: Final = "net.visual_encoder"
BACKBONE: Final = f"{ENCODER}.backbone"
GRU: Final = "net.state_encoder.rnn"


@dataclass(frozen=True, slots=True)
class ResidualBlock:
    """Residual block of three convolutions; the second carries the stride."""

    name: str
    """Prefix of its weights."""
    channels: int
    planes: int
    stride: int

    @property
    def wide(self) -> int:
        """Channels of its output."""
        return self.planes * _EXPANSION

    @property
    def resized(self) -> bool:
        """Whether a convolution fits its input to its output."""
        return self.stride != 1 or self.channels != self.wide


def residual_blocks(architecture: Architecture) -> Iterator[ResidualBlock]:
    """Yield the blocks of the backbone in their order."""
    channels = architecture.base_planes
    for level, blocks in enumerate(BLOCKS):
        for number in range(blocks):
            stride = 2 if level > 0 and number == 0 else 1
            block = ResidualBlock(
                f"{BACKBONE}.layer{level + 1}.{number}", channels, architecture.base_planes * 2**level, stride
            )
            yield block
            channels = block.wide


def expected_shapes(architecture: Architecture) -> dict[str, tuple[int, ...]]:
    """Return the shape of every weight, in the order of the network."""
    sizes = architecture
    shapes: dict[str, tuple[int, ...]] = {}

    def convolution(name: str, norm: str, outputs: int, inputs: int, kernel: int) -> None:
        shapes[f"{name}.weight"] = (outputs, inputs, kernel, kernel)
        shapes[f"{norm}.weight"] = shapes[f"{norm}.bias"] = (outputs,)

    def linear(name: str, outputs: int, inputs: int) -> None:
        shapes[f"{name}.weight"], shapes[f"{name}.bias"] = (outputs, inputs), (outputs,)

    statistics = f"{ENCODER}.running_mean_and_var"
    shapes[f"{statistics}._mean"] = shapes[f"{statistics}._var"] = (1, 3, 1, 1)
    shapes[f"{statistics}._count"] = ()
    convolution(f"{BACKBONE}.conv1", f"{BACKBONE}.bn1", sizes.base_planes, 3, 7)
    for block in residual_blocks(sizes):
        convolution(f"{block.name}.conv1", f"{block.name}.bn1", block.planes, block.channels, 1)
        convolution(f"{block.name}.conv2", f"{block.name}.bn2", block.planes, block.planes, 3)
        convolution(f"{block.name}.conv3", f"{block.name}.bn3", block.wide, block.planes, 1)
        if block.resized:
            convolution(f"{block.name}.downsample.0", f"{block.name}.downsample.1", block.wide, block.channels, 1)
    compressed = sizes.compressed_channels
    convolution(f"{ENCODER}.compression.0", f"{ENCODER}.compression.1", compressed, block.wide, 3)
    linear("net.visual_fc.1", sizes.visual_size, compressed * sizes.final_grid_px**2)
    linear("net.gps_embedding", EMBEDDING_SIZE, GPS_SIZE)
    linear("net.compass_embedding", EMBEDDING_SIZE, COMPASS_SIZE)
    shapes["net.obj_categories_embedding.weight"] = (sizes.goals, EMBEDDING_SIZE)
    shapes["net.prev_action_embedding.weight"] = (sizes.actions + 1, EMBEDDING_SIZE)
    gates = 3 * sizes.hidden_size
    for layer in range(sizes.recurrent_layers):
        inputs = sizes.hidden_size if layer else sizes.recurrent_input_size
        shapes[f"{GRU}.weight_ih_l{layer}"] = (gates, inputs)
        shapes[f"{GRU}.weight_hh_l{layer}"] = (gates, sizes.hidden_size)
        shapes[f"{GRU}.bias_ih_l{layer}"] = shapes[f"{GRU}.bias_hh_l{layer}"] = (gates,)
    linear("action_distribution.linear", sizes.actions, sizes.hidden_size)
    if sizes.critic:
        linear("critic.fc", 1, sizes.hidden_size)
    return shapes
