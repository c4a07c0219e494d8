"""Distances by fast marching are those of scikit-fmm, bit for bit."""

import numpy as np
import pytest
import skfmm

from vsnbench.protocol.fast_marching import signed_distance_m

RESOLUTION_M = 0.05


@pytest.mark.parametrize("seed", range(30))
def test_distances_equal_those_of_scikit_fmm(seed: int) -> None:
    random = np.random.default_rng(seed)
    rows, columns = random.integers(8, 60, 2)
    row, column = np.mgrid[:rows, :columns]
    centre = random.uniform(0, rows), random.uniform(0, columns)
    level = RESOLUTION_M * np.hypot(row - centre[0], column - centre[1]) - random.uniform(0.1, 0.6)
    if seed % 3 == 0:  # cells exactly on the contour
        level = np.round(level, 1)
    free = random.random((rows, columns)) > random.uniform(0, 0.4)
    free[round(centre[0]) % rows, round(centre[1]) % columns] = True
    expected = np.ma.filled(skfmm.distance(np.ma.MaskedArray(level, mask=~free), dx=RESOLUTION_M, order=2), np.inf)
    found = signed_distance_m(level, free, RESOLUTION_M)
    assert np.isinf(found[~free]).all()
    np.testing.assert_array_equal(found[free], expected[free])
    assert np.isfinite(found).sum() > 0
