"""The value network: a Q network on ResNet-18 that estimates how soon each class of goal is reached.

The value of an image for a class is the largest of its Q values over the actions.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from vsnbench.models.checkpoints.residual_network import BasicBlock, ResidualNetwork
from vsnbench.models.vlv.goals import VALUE_CLASSES

IMAGE_SIZE_PX: Final = 224
ACTIONS: Final = 3
_MEAN = (0.485, 0.456, 0.406)
_STD = (0.229, 0.224, 0.225)


class ValueNetwork(nn.Module):
    """The original's network, without its duplicate and unused tensors."""

    def __init__(self) -> None:
        super().__init__()
        self.resnet = ResidualNetwork(BasicBlock, (2, 2, 2, 2))
        self.squeeze = nn.Conv2d(512, 64, 3)
        outputs = len(VALUE_CLASSES) * ACTIONS
        self.top = nn.Sequential(
            nn.Linear(1600, 512), nn.ReLU(), nn.Linear(512, 256), nn.ReLU(), nn.Linear(256, outputs)
        )

    def forward(self, images: Tensor) -> Tensor:
        """Return Q values (N, classes, actions) of normalised images (N, 3, 224, 224)."""
        features = torch.relu(self.squeeze(self.resnet(images)[3]))
        q: Tensor = self.top(features.flatten(1)).unflatten(1, (len(VALUE_CLASSES), ACTIONS))
        return q


def build_value_network(weights: Mapping[str, Tensor], device: str = "cpu") -> ValueNetwork:
    """Return the network with weights named as in the released file."""
    network = ValueNetwork()
    network.load_state_dict({name: weights[name_in_file] for name, name_in_file in names_in_file().items()})
    return network.eval().to(device)


def names_in_file() -> dict[str, str]:
    """Return the name of each tensor in the released file, by its name in `ValueNetwork`."""
    with torch.device("meta"):
        network = ValueNetwork()
    return {name: name.replace("squeeze.", "features.8.") for name in network.state_dict()}


def preprocess(rgb: npt.NDArray[np.uint8]) -> Tensor:
    """Return an image (H, W, 3) as the network's input (1, 3, 224, 224): resized, ImageNet's mean and deviation."""
    import cv2

    if rgb.shape[:2] != (IMAGE_SIZE_PX, IMAGE_SIZE_PX):
        rgb = np.asarray(cv2.resize(rgb, (IMAGE_SIZE_PX, IMAGE_SIZE_PX), interpolation=cv2.INTER_AREA), np.uint8)
    pixels = (rgb.astype(np.float32) / 255 - np.array(_MEAN, np.float32)) / np.array(_STD, np.float32)
    return torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))[None]


@torch.inference_mode()
def q_values(network: ValueNetwork, rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Return (classes, actions) for one image (H, W, 3)."""
    device = next(network.parameters()).device
    answer: npt.NDArray[np.float32] = network(preprocess(rgb).to(device))[0].cpu().numpy()
    return answer
