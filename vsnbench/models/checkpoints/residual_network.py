"""Residual networks in torchvision's layout: basic blocks (ResNet-18) and bottlenecks (ResNet-50)."""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn

Normalisation = Callable[[int], nn.Module]


class BasicBlock(nn.Module):
    """Two 3 x 3 convolutions with a shortcut."""

    expansion = 1

    def __init__(self, inputs: int, planes: int, stride: int, norm: Normalisation) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, planes, 3, stride, 1, bias=False)
        self.bn1 = norm(planes)
        self.conv2 = nn.Conv2d(planes, planes, 3, 1, 1, bias=False)
        self.bn2 = norm(planes)
        self.downsample = _shortcut(inputs, planes, stride, norm)

    def forward(self, x: Tensor) -> Tensor:
        """Map (N, inputs, H, W) to (N, planes, H / stride, W / stride)."""
        shortcut = x if self.downsample is None else self.downsample(x)
        x = torch.relu(self.bn1(self.conv1(x)))
        return torch.relu(self.bn2(self.conv2(x)) + shortcut)


class Bottleneck(nn.Module):
    """A 3 x 3 convolution between two 1 x 1, with a shortcut. The 3 x 3 convolution has the stride."""

    expansion = 4

    def __init__(self, inputs: int, planes: int, stride: int, norm: Normalisation) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, planes, 1, bias=False)
        self.bn1 = norm(planes)
        self.conv2 = nn.Conv2d(planes, planes, 3, stride, 1, bias=False)
        self.bn2 = norm(planes)
        self.conv3 = nn.Conv2d(planes, planes * self.expansion, 1, bias=False)
        self.bn3 = norm(planes * self.expansion)
        self.downsample = _shortcut(inputs, planes * self.expansion, stride, norm)

    def forward(self, x: Tensor) -> Tensor:
        """Map (N, inputs, H, W) to (N, 4 x planes, H / stride, W / stride)."""
        shortcut = x if self.downsample is None else self.downsample(x)
        x = torch.relu(self.bn1(self.conv1(x)))
        x = torch.relu(self.bn2(self.conv2(x)))
        return torch.relu(self.bn3(self.conv3(x)) + shortcut)


class ResidualNetwork(nn.Module):
    """Stem and four layers, without a classifier."""

    def __init__(
        self,
        block: type[BasicBlock] | type[Bottleneck],
        depths: Sequence[int],
        norm: Normalisation = nn.BatchNorm2d,
        base_planes: int = 64,
    ) -> None:
        """Build the network.

        Args:
            block: kind of the blocks.
            depths: number of blocks of each layer.
            norm: returns the normalisation of a number of channels.
            base_planes: channels of the stem, and planes of the first layer's blocks; each layer has twice as many.
        """
        super().__init__()
        self.conv1 = nn.Conv2d(3, base_planes, 7, 2, 3, bias=False)
        self.bn1 = norm(base_planes)
        inputs = base_planes
        layers = []
        for index, depth in enumerate(depths):
            planes = base_planes * 2**index
            blocks: list[nn.Module] = []
            for k in range(depth):
                blocks.append(block(inputs, planes, 2 if index and k == 0 else 1, norm))
                inputs = planes * block.expansion
            layers.append(nn.Sequential(*blocks))
        self.layer1, self.layer2, self.layer3, self.layer4 = layers

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the outputs of the four layers for (N, 3, H, W): strides 4, 8, 16, 32."""
        x = torch.relu(self.bn1(self.conv1(x)))
        x = nn.functional.max_pool2d(x, 3, 2, 1)
        first = self.layer1(x)
        second = self.layer2(first)
        third = self.layer3(second)
        return first, second, third, self.layer4(third)


def _shortcut(inputs: int, outputs: int, stride: int, norm: Normalisation) -> nn.Sequential | None:
    if stride == 1 and inputs == outputs:
        return None
    return nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), norm(outputs))
