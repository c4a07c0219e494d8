"""A region of invalid pixels is named as a person would describe it."""

import numpy as np
import pytest

from vsnbench.sensing.images.regions import invalid_region


@pytest.mark.parametrize(
    ("where", "text"),
    [
        (np.s_[:, :320], "the left half of the depth image"),
        (np.s_[:, 320:], "the right half of the depth image"),
        (np.s_[240:], "the lower half of the depth image"),
        (np.s_[:120], "the upper 25% of the depth image"),
        (np.s_[:, 192:], "the right 70% of the depth image"),
        (np.s_[:], "the whole depth image"),
        (np.s_[240:, 256:384], "columns 256 to 383, rows 240 to 479 of the depth image"),
    ],
)
@pytest.mark.parametrize("valid_share", [0.0, 0.05])
def test_a_rectangle_is_named(where: object, text: str, valid_share: float) -> None:
    invalid = np.zeros((480, 640), bool)
    invalid[where] = np.random.default_rng(0).random(invalid[where].shape) >= valid_share
    region = invalid_region(invalid)
    assert region.text == text
    assert region.share == pytest.approx(np.mean(invalid) / (1 - valid_share), abs=0.02)


def test_scattered_holes_are_no_region() -> None:
    assert invalid_region(np.random.default_rng(0).random((480, 640)) < 0.6).share == 0


def test_several_regions_are_a_share_of_the_image() -> None:
    invalid = np.zeros((480, 640), bool)
    invalid[:120, :160] = invalid[360:, 480:] = True
    assert invalid_region(invalid).text.endswith("% of the depth image")
