"""Units of the session summary."""

import pytest

from vsnbench.runner.operator.session_summary import driven_text


@pytest.mark.parametrize(
    ("driven_s", "driven_m", "words"),
    [
        (0.0, 0.0, "0 s, 0.0 m"),
        (5.1, 0.5, "5 s, 0.5 m"),
        (90.0, 12.34, "2 min, 12.3 m"),
        (3600.0, 999.0, "1.0 h, 999.0 m"),
        (9000.0, 1234.0, "2.5 h, 1.23 km"),
    ],
)
def test_driven_time_and_distance_have_suitable_units(driven_s: float, driven_m: float, words: str) -> None:
    assert driven_text(driven_s, driven_m) == words
