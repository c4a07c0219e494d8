"""Stand-in for goat_bench/obs_transformer/resize.py (Ram81/goat-bench, commit 74c41d1)."""

import torch


def image_resize(img, size, channels_last=False, interpolation_mode="area"):
    assert channels_last
    resized = torch.nn.functional.interpolate(img.permute(0, 3, 1, 2).float(), size=size, mode=interpolation_mode)
    return resized.permute(0, 2, 3, 1).to(img.dtype)
