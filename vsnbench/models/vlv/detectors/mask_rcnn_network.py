"""Mask R-CNN with ResNet-50 and a feature pyramid in PyTorch, with torchvision's names and numbers.

It does not use torchvision, whose package has compiled operators that need CUDA libraries and cannot be imported with a
CPU build of PyTorch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn

from vsnbench.models.checkpoints.residual_network import Bottleneck, ResidualNetwork
from vsnbench.models.vlv.detectors.boxes import anchors, best_of_overlapping, clip, decode, large
from vsnbench.models.vlv.detectors.region_pooling import pool_regions

_MEAN, _STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_SHORT_SIDE_PX, _LONG_SIDE_PX, _MULTIPLE_PX = 800.0, 1333.0, 32
_ANCHOR_SIZES_PX = (32, 64, 128, 256, 512)
_MAX_PROPOSALS: Final = 1000
_PROPOSAL_OVERLAP, _OBJECT_OVERLAP = 0.7, 0.5
_LEAST_SCORE: Final = 0.05
_MAX_OBJECTS: Final = 100


class FrozenNormalisation(nn.Module):
    """Batch normalisation with fixed statistics. The released weights were trained without an epsilon."""

    def __init__(self, channels: int, epsilon: float = 0.0) -> None:
        super().__init__()
        self.epsilon = epsilon
        for name in ("weight", "bias", "running_mean", "running_var"):
            self.register_buffer(name, torch.ones(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Scale and shift (N, C, H, W)."""
        weight, bias = self.get_buffer("weight"), self.get_buffer("bias")
        mean, var = self.get_buffer("running_mean"), self.get_buffer("running_var")
        scale = weight * (var + self.epsilon).rsqrt()
        return x * scale[:, None, None] + (bias - mean * scale)[:, None, None]


class FeaturePyramid(nn.Module):
    """Converts the four layers to 256 channels and adds coarse to fine ones. The fifth map subsamples the fourth."""

    def __init__(self) -> None:
        super().__init__()
        self.inner_blocks = nn.ModuleList(nn.Sequential(nn.Conv2d(inputs, 256, 1)) for inputs in (256, 512, 1024, 2048))
        self.layer_blocks = nn.ModuleList(nn.Sequential(nn.Conv2d(256, 256, 3, padding=1)) for _ in range(4))

    def forward(self, layers: Sequence[Tensor]) -> list[Tensor]:
        """Return five maps of strides 4 to 64."""
        inner = self.inner_blocks[3](layers[3])
        maps = [self.layer_blocks[3](inner)]
        for k in (2, 1, 0):
            across = self.inner_blocks[k](layers[k])
            inner = across + nn.functional.interpolate(inner, size=across.shape[-2:], mode="nearest")
            maps.insert(0, self.layer_blocks[k](inner))
        return [*maps, nn.functional.max_pool2d(maps[-1], 1, 2, 0)]


class Backbone(nn.Module):
    """ResNet-50 and the pyramid."""

    def __init__(self) -> None:
        super().__init__()
        self.body = ResidualNetwork(Bottleneck, (3, 4, 6, 3), FrozenNormalisation)
        self.fpn = FeaturePyramid()

    def forward(self, image: Tensor) -> list[Tensor]:
        """Return five maps of strides 4 to 64."""
        maps: list[Tensor] = self.fpn(self.body(image))
        return maps


class ProposalHead(nn.Module):
    """Scores each anchor as object or background, and predicts its offsets."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Sequential(nn.Sequential(nn.Conv2d(256, 256, 3, padding=1)))
        self.cls_logits = nn.Conv2d(256, 3, 1)
        self.bbox_pred = nn.Conv2d(256, 12, 1)

    def forward(self, feature: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (h * w * 3,) and offsets (h * w * 3, 4) of a map (1, 256, h, w)."""
        hidden = torch.relu(self.conv(feature))
        logits, offsets = self.cls_logits(hidden)[0], self.bbox_pred(hidden)[0]
        return logits.permute(1, 2, 0).reshape(-1), offsets.permute(1, 2, 0).reshape(-1, 4)


class ProposalNetwork(nn.Module):
    """Proposes regions."""

    def __init__(self) -> None:
        super().__init__()
        self.head = ProposalHead()

    def forward(self, features: Sequence[Tensor], padded: tuple[int, int], image: tuple[int, int]) -> Tensor:
        """Return up to 1000 boxes (N, 4)."""
        boxes, scores, levels = [], [], []
        for level, (feature, anchor) in enumerate(
            zip(features, anchors(padded, features, _ANCHOR_SIZES_PX), strict=True)
        ):
            logits, offsets = self.head(feature)
            best = logits.topk(min(_MAX_PROPOSALS, logits.numel())).indices
            boxes.append(clip(decode(offsets[best], anchor[best], (1.0, 1.0, 1.0, 1.0))[:, 0], image))
            scores.append(torch.sigmoid(logits[best]))
            levels.append(torch.full_like(best, level))
        together, score, level_of = torch.cat(boxes), torch.cat(scores), torch.cat(levels)
        fit = large(together, 1e-3)
        together, score, level_of = together[fit], score[fit], level_of[fit]
        best = best_of_overlapping(together, score, level_of, _PROPOSAL_OVERLAP)[:_MAX_PROPOSALS]
        return together[best]


class BoxHead(nn.Module):
    """Two dense layers over a pooled region."""

    def __init__(self) -> None:
        super().__init__()
        self.fc6 = nn.Linear(256 * 49, 1024)
        self.fc7 = nn.Linear(1024, 1024)

    def forward(self, regions: Tensor) -> Tensor:
        """Map (N, 256, 7, 7) to (N, 1024)."""
        return torch.relu(self.fc7(torch.relu(self.fc6(regions.flatten(1)))))


class BoxPredictor(nn.Module):
    """Class scores and a box for each class."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.cls_score = nn.Linear(1024, classes)
        self.bbox_pred = nn.Linear(1024, classes * 4)


class MaskPredictor(nn.Module):
    """A mask of 28 x 28 for each class."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.conv5_mask = nn.ConvTranspose2d(256, 256, 2, 2)
        self.mask_fcn_logits = nn.Conv2d(256, classes, 1)

    def forward(self, regions: Tensor) -> Tensor:
        """Map (N, 256, 14, 14) to logits (N, classes, 28, 28)."""
        logits: Tensor = self.mask_fcn_logits(torch.relu(self.conv5_mask(regions)))
        return logits


class RegionHeads(nn.Module):
    """Classes, boxes and masks of the proposals."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.box_head = BoxHead()
        self.box_predictor = BoxPredictor(classes)
        self.mask_head = nn.Sequential(*(nn.Sequential(nn.Conv2d(256, 256, 3, padding=1), nn.ReLU()) for _ in range(4)))
        self.mask_predictor = MaskPredictor(classes)


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """Objects in an image, best first."""

    boxes: Tensor
    """(N, 4) in pixels of the original image."""
    labels: Tensor
    """(N,) numbers of classes; 0 (background) does not occur."""
    scores: Tensor
    masks: Tensor
    """(N, 28, 28) probabilities within the boxes."""


class MaskRCNN(nn.Module):
    """The whole network."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.rpn = ProposalNetwork()
        self.roi_heads = RegionHeads(classes)

    def forward(self, image: Tensor) -> Objects:
        """Find objects in one image (3, H, W) in [0, 1]."""
        original = (int(image.shape[1]), int(image.shape[2]))
        batch, size = _prepare(image)
        features = self.backbone(batch)
        proposals = self.rpn(features, (int(batch.shape[2]), int(batch.shape[3])), size)
        boxes, labels, scores = self._classify(features[:4], proposals, size)
        regions = self.roi_heads.mask_head(pool_regions(features[:4], boxes, size, 14))
        masks = torch.sigmoid(self.roi_heads.mask_predictor(regions))
        masks = masks[torch.arange(len(labels), device=labels.device), labels]
        ratio = torch.tensor([original[1] / size[1], original[0] / size[0]] * 2, device=boxes.device)
        return Objects(boxes * ratio, labels, scores, masks)

    def _classify(
        self, features: Sequence[Tensor], proposals: Tensor, image: tuple[int, int]
    ) -> tuple[Tensor, Tensor, Tensor]:
        heads = self.roi_heads
        hidden = heads.box_head(pool_regions(features, proposals, image, 7))
        scores = torch.softmax(heads.box_predictor.cls_score(hidden), -1)[:, 1:]
        boxes = clip(decode(heads.box_predictor.bbox_pred(hidden), proposals, (10.0, 10.0, 5.0, 5.0)), image)[:, 1:]
        labels = torch.arange(1, scores.shape[1] + 1, device=scores.device).expand_as(scores)
        scores, boxes, labels = scores.reshape(-1), boxes.reshape(-1, 4), labels.reshape(-1)
        fit = (scores > _LEAST_SCORE) & large(boxes, 1e-2)
        scores, boxes, labels = scores[fit], boxes[fit], labels[fit]
        best = best_of_overlapping(boxes, scores, labels, _OBJECT_OVERLAP)[:_MAX_OBJECTS]
        return boxes[best], labels[best], scores[best]


def _prepare(image: Tensor) -> tuple[Tensor, tuple[int, int]]:
    """Normalise, resize and pad the image to (1, 3, H', W'). Returns it with its size before padding."""
    mean, std = torch.tensor(_MEAN, device=image.device), torch.tensor(_STD, device=image.device)
    image = (image - mean[:, None, None]) / std[:, None, None]
    short, long = min(image.shape[1:]), max(image.shape[1:])
    scale = min(_SHORT_SIDE_PX / short, _LONG_SIDE_PX / long)
    resized = nn.functional.interpolate(
        image[None], scale_factor=scale, mode="bilinear", recompute_scale_factor=True, align_corners=False
    )
    height, width = int(resized.shape[2]), int(resized.shape[3])
    padding = (0, -width % _MULTIPLE_PX, 0, -height % _MULTIPLE_PX)
    return nn.functional.pad(resized, padding), (height, width)
