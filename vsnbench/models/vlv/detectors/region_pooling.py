"""Pools regions of feature maps of several scales to one size (RoIAlign over a feature pyramid)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

_SAMPLES = 2
"""Samples along each side of a bin."""
_CANONICAL_SIDE_PX, _CANONICAL_LEVEL = 224.0, 4.0
_MAX_SAMPLES = 1 << 17
"""Maximum number of positions sampled at once, which limits memory."""


def pool_regions(features: Sequence[Tensor], boxes: Tensor, image: tuple[int, int], size: int) -> Tensor:
    """Return (N, C, size, size) for boxes (N, 4), each from the map that matches its size.

    Args:
        features: maps (1, C, h, w) of strides 4, 8, 16, 32.
        boxes: boxes in pixels of the image.
        image: its (height, width) before padding.
        size: number of bins per side.
    """
    scales = [_scale(feature.shape[-2], image[0]) for feature in features]
    finest, coarsest = -torch.log2(torch.tensor(scales[0])), -torch.log2(torch.tensor(scales[-1]))
    side = torch.sqrt((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))
    level = torch.floor(_CANONICAL_LEVEL + torch.log2(side / _CANONICAL_SIDE_PX) + 1e-6)
    level = (level.clamp(float(finest), float(coarsest)) - finest.to(boxes.device)).to(torch.int64)
    pooled = torch.zeros(boxes.shape[0], features[0].shape[1], size, size, device=boxes.device)
    chunk = max(1, _MAX_SAMPLES // (size * _SAMPLES) ** 2)
    for index, (feature, scale) in enumerate(zip(features, scales, strict=True)):
        members = torch.nonzero(level == index)[:, 0]
        for some in torch.split(members, chunk):
            pooled[some] = _align(feature, boxes[some] * scale, size)
    return pooled


def _scale(feature_px: int, image_px: int) -> float:
    """Return the map's scale as the power of two nearest to the ratio of the sizes."""
    return float(2.0 ** torch.log2(torch.tensor(feature_px / image_px)).round())


def _align(feature: Tensor, boxes: Tensor, size: int) -> Tensor:
    """Return (n, C, size, size): means of bilinear samples. Coordinates are clamped to the map."""
    height, width = feature.shape[-2:]
    count = size * _SAMPLES
    steps = (torch.arange(count, device=boxes.device, dtype=torch.float32) + 0.5) / count
    x = boxes[:, 0, None] + (boxes[:, 2] - boxes[:, 0]).clamp(min=1.0)[:, None] * steps
    y = boxes[:, 1, None] + (boxes[:, 3] - boxes[:, 1]).clamp(min=1.0)[:, None] * steps
    x = 2 * x / max(width - 1, 1) - 1
    y = 2 * y / max(height - 1, 1) - 1
    n = boxes.shape[0]
    grid = torch.stack([x[:, None, :].expand(n, count, count), y[:, :, None].expand(n, count, count)], -1)
    sampled = nn.functional.grid_sample(
        feature, grid.reshape(1, n * count, count, 2), mode="bilinear", padding_mode="border", align_corners=True
    )
    channels = feature.shape[1]
    regions = sampled.reshape(channels, n, count, count).transpose(0, 1)
    return nn.functional.avg_pool2d(regions, _SAMPLES)
