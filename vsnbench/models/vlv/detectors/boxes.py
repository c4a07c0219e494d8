"""Box operations of region detectors: anchors, decoding, clipping and non-maximum suppression.

Boxes are rows (left, top, right, bottom) in pixels.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

_MAX_LOG = math.log(1000.0 / 16)


def anchors(image: tuple[int, int], features: Sequence[Tensor], sizes_px: Sequence[int]) -> list[Tensor]:
    """Return the anchors (h * w * 3, 4) of each feature map (1, C, h, w): three shapes per cell.

    Args:
        image: (height, width) of the padded image.
        features: one map per size, finest first.
        sizes_px: side of the square anchor on each map.
    """
    grids = []
    for feature, size_px in zip(features, sizes_px, strict=True):
        height, width = feature.shape[-2:]
        tall = torch.sqrt(torch.tensor([0.5, 1.0, 2.0], device=feature.device))
        wide = 1 / tall
        half = torch.stack([-wide * size_px, -tall * size_px, wide * size_px, tall * size_px], 1) / 2
        y = torch.arange(height, device=feature.device, dtype=torch.float32) * (image[0] // height)
        x = torch.arange(width, device=feature.device, dtype=torch.float32) * (image[1] // width)
        down, right = torch.meshgrid(y, x, indexing="ij")
        shifts = torch.stack([right, down, right, down], 2).reshape(-1, 1, 4)
        grids.append((shifts + half.round()).reshape(-1, 4))
    return grids


def decode(offsets: Tensor, reference: Tensor, weights: tuple[float, float, float, float]) -> Tensor:
    """Return (N, K, 4) boxes from offsets (N, K * 4) relative to reference boxes (N, 4)."""
    width, height = reference[:, 2] - reference[:, 0], reference[:, 3] - reference[:, 1]
    x, y = reference[:, 0] + 0.5 * width, reference[:, 1] + 0.5 * height
    offsets = offsets.reshape(reference.shape[0], -1, 4)
    new_x = offsets[..., 0] / weights[0] * width[:, None] + x[:, None]
    new_y = offsets[..., 1] / weights[1] * height[:, None] + y[:, None]
    half_width = 0.5 * torch.exp((offsets[..., 2] / weights[2]).clamp(max=_MAX_LOG)) * width[:, None]
    half_height = 0.5 * torch.exp((offsets[..., 3] / weights[3]).clamp(max=_MAX_LOG)) * height[:, None]
    return torch.stack([new_x - half_width, new_y - half_height, new_x + half_width, new_y + half_height], -1)


def clip(boxes: Tensor, image: tuple[int, int]) -> Tensor:
    """Return boxes (..., 4) cut to an image of (height, width)."""
    x, y = boxes[..., 0::2].clamp(0, image[1]), boxes[..., 1::2].clamp(0, image[0])
    return torch.stack([x[..., 0], y[..., 0], x[..., 1], y[..., 1]], -1)


def large(boxes: Tensor, least_px: float) -> Tensor:
    """Return (N,): whether both sides of a box are at least `least_px` long."""
    return (boxes[:, 2] - boxes[:, 0] >= least_px) & (boxes[:, 3] - boxes[:, 1] >= least_px)


def best_of_overlapping(boxes: Tensor, scores: Tensor, groups: Tensor, most_overlap: float) -> Tensor:
    """Return the indices of the boxes to keep, best score first (non-maximum suppression).

    Args:
        boxes: (N, 4).
        scores: (N,).
        groups: (N,) group of each box; only boxes of the same group suppress each other.
        most_overlap: intersection over union above which the worse box is dropped.
    """
    selected = []
    for group in torch.unique(groups):
        members = torch.nonzero(groups == group)[:, 0]
        members = members[torch.sort(scores[members], descending=True, stable=True).indices]
        overlap = (overlaps(boxes[members]) > most_overlap).cpu().numpy()
        alive = np.ones(len(members), np.bool_)
        for k in range(len(members)):
            if alive[k]:
                alive[k + 1 :] &= ~overlap[k, k + 1 :]
        selected.append(members[torch.from_numpy(alive).to(members.device)])
    if not selected:
        return torch.zeros(0, dtype=torch.int64, device=boxes.device)
    together = torch.cat(selected)
    return together[torch.sort(scores[together], descending=True, stable=True).indices]


def overlaps(boxes: Tensor) -> Tensor:
    """Return (N, N) intersection over union."""
    area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    low, high = torch.maximum(boxes[:, None, :2], boxes[:, :2]), torch.minimum(boxes[:, None, 2:], boxes[:, 2:])
    inside = (high - low).clamp(min=0).prod(2)
    return inside / (area[:, None] + area - inside)
