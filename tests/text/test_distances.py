"""A printed distance is on the same side of the success distance as the distance itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.text.distances import distance_text


@pytest.mark.parametrize(
    ("distance_m", "success_m", "text"),
    [
        (0.84, 1.0, "0.84"),
        (1.0, 1.0, "1.00"),
        (1.001, 1.0, "1.001"),
        (0.9996, 1.0, "0.9996"),
        (0.99999, 1.0, "0.99999"),
        (0.358, 0.36, "0.358"),
        (0.36, 0.36, "0.36"),
        (1.001, None, "1.00"),
        (float("nan"), 1.0, "nan"),
    ],
)
def test_digits_are_added_only_near_the_success_distance(distance_m: float, success_m: float | None, text: str) -> None:
    assert distance_text(distance_m, success_m) == text


@given(
    st.floats(0, 60), st.floats(0.01, 10) | st.sampled_from([1.0, 0.36, 0.5]), st.integers(0, 3), st.floats(-1e-5, 1e-5)
)
def test_a_printed_distance_succeeds_exactly_when_the_distance_does(
    distance_m: float, success_m: float, decimals: int, off_m: float
) -> None:
    for value in (distance_m, max(success_m + off_m, 0.0)):
        text = distance_text(value, success_m, decimals)
        assert (float(text) < success_m) == (value < success_m)
        assert (float(text) == success_m) <= (value == success_m)
