"""Stand-in for goat_bench/models/encoders/clip.py (Ram81/goat-bench, commit 74c41d1): embeddings of 1024 numbers."""

from types import SimpleNamespace

import numpy as np
import torch


class CLIPEncoder:
    def __init__(self, name="RN50", device="cuda"):
        self.model = SimpleNamespace(encode_text=lambda tokens: torch.full((1, 1024), float(tokens.sum())))

    def embed_vision(self, observations):
        assert observations.dtype == np.uint8
        return np.full(1024, observations.mean(), np.float32)
