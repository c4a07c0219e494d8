"""Which seeds may be trained on, which only validated or tested on; declared once, so that no twin is in two splits."""

from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Split(StrEnum):
    """What a generated site may be used for."""

    TRAINING = "training"
    VALIDATION = "validation"
    TEST = "test"


SEEDS: Final = MappingProxyType(
    {
        Split.TEST: range(1_000),
        Split.VALIDATION: range(1_000, 2_000),
        Split.TRAINING: range(10_000, 1_000_000),
    }
)
"""The seeds of each split; those of no split are nobody's."""


def split_of(seed: int) -> Split | None:
    """Return the split that a seed belongs to."""
    return next((split for split, seeds in SEEDS.items() if seed in seeds), None)
