"""The statistics equal numpy's, over all rows and all pixels."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.interop.lerobot.statistics import QUANTILES, image_statistics, pixel_counts, vector_statistics

NAMES = {"min", "max", "mean", "std", "count", *QUANTILES}


@settings(deadline=None)  # counting 16-bit values takes longer on a busy machine
@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 200, 256, 65536]), st.integers(1, 3), st.integers(1, 3))
def test_images_have_the_statistics_of_their_pixels(seed: int, values: int, images: int, channels: int) -> None:
    dtype = np.uint8 if values <= 256 else np.uint16
    pixels = np.random.default_rng(seed).integers(0, values, (images, 3, 4, channels)).astype(dtype)
    found = image_statistics(sum(pixel_counts(image) for image in pixels), images, 255.0)  # type: ignore[arg-type]
    scaled = pixels.reshape(-1, channels) / 255.0
    assert set(found) == NAMES
    assert found["count"].tolist() == [images]
    for name in ("min", "max", "mean", "std"):
        expected = getattr(scaled, name)(axis=0).reshape(-1, 1, 1)
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=1e-9)
    for name, share in QUANTILES.items():
        expected = np.quantile(scaled, share, axis=0).reshape(-1, 1, 1)
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=1e-9)


def test_flags_and_numbers_have_a_component_each() -> None:
    flags = vector_statistics(np.array([False, True, True, True]))
    assert (flags["mean"].tolist(), flags["min"].tolist(), flags["count"].tolist()) == ([0.75], [0.0], [4])
    vectors = vector_statistics(np.array([[1, 10], [3, 30]], np.float32))
    assert {name: values.shape for name, values in vectors.items()} == dict.fromkeys(NAMES, (2,)) | {"count": (1,)}
    assert vectors["q50"].tolist() == [2.0, 20.0]
