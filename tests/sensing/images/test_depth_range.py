"""A depth image in the wrong unit is detected by its range."""

import numpy as np
import pytest

from vsnbench.sensing.images.depth_range import range_fault
from vsnbench.values.camera import Camera

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.4, depth_max_m=8)


def image(low_m: float, high_m: float) -> np.ndarray:
    return np.linspace(low_m, high_m, 64 * 48, dtype=np.float32).reshape(48, 64)


@pytest.mark.parametrize(
    ("depth", "wrong"),
    [
        (image(0.5, 7.0), False),
        (image(0.5, 7.0) * np.float32(1000), True),
        ((image(0.5, 7.0) * 1000).astype(np.uint16), False),
        (image(0.5, 7.0).astype(np.uint16), True),
        (image(0.3, 0.39), False),
        (image(1.2, 14.0), False),
        (np.full((48, 64), np.nan, np.float32), False),
        (np.zeros((48, 64), np.uint16), False),
        (np.full((48, 64), 65535, np.uint16), False),
    ],
    ids=[
        "metres",
        "millimetres as metres",
        "millimetres",
        "metres as millimetres",
        "too near",
        "a large hall",
        "blind",
        "zero",
        "saturated",
    ],
)
def test_a_wrong_unit_is_a_fault_and_a_right_one_is_not(depth: np.ndarray, wrong: bool) -> None:
    assert bool(range_fault(depth, CAMERA)) is wrong


def test_the_fault_names_what_was_measured_and_what_can_be() -> None:
    fault = range_fault(image(1.0, 1.0) * np.float32(1000), CAMERA)
    assert "1e+03 to 1e+03 m" in fault
    assert "0.4 to 8 m" in fault
