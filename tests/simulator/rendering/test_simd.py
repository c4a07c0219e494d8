"""SIMD kernels compile with the installed numba and llvmlite, and round like scalar arithmetic."""

import numpy as np
import pytest
from numba import TypingError

from vsnbench.runtime.numba_cache import compiled
from vsnbench.simulator.rendering.simd import first_three_steps, four_at


@compiled
def _blend(numbers, stored, row, share):  # type: ignore[no-untyped-def]
    value = (four_at(numbers, row) * share + four_at(numbers, row + 1)) * four_at(stored, row)
    return first_three_steps(value + share, 250)


def test_four_lanes_round_like_scalars() -> None:
    rng = np.random.default_rng(3)
    numbers = rng.uniform(0, 2, (40, 4)).astype(np.float32)
    stored = rng.integers(0, 255, (40, 4)).astype(np.uint8)
    for row in range(39):
        share = np.float32(rng.uniform())
        expected = (numbers[row] * share + numbers[row + 1]) * stored[row].astype(np.float32) + share
        assert _blend(numbers, stored, row, share) == tuple(int(min(value, 250)) for value in expected[:3])


def test_arrays_of_other_types_are_refused() -> None:
    with pytest.raises(TypingError, match="float32 or uint8"):
        _blend(np.zeros((2, 4)), np.zeros((2, 4), np.uint8), 0, np.float32(0))
