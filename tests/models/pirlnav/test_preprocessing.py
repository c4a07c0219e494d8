"""The image the network sees: no antialiasing, whole levels, the middle."""

import numpy as np
import pytest
import torch

from tests.models.pirlnav.conftest import Recording
from vsnbench.models.pirlnav.preprocessing import augment, preprocess


def camera_image(height: int, width: int, seed: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)


def by_hand(rgb: np.ndarray, size: int, row: int, column: int) -> np.ndarray:
    """Bilinear sample of one pixel of the crop, in double precision, from its four neighbours alone."""
    height, width = rgb.shape[:2]
    scaled = (size * height // min(height, width), size * width // min(height, width))
    offset = [round((side - size) / 2) for side in scaled]
    y = max((row + offset[0] + 0.5) * height / scaled[0] - 0.5, 0)
    x = max((column + offset[1] + 0.5) * width / scaled[1] - 0.5, 0)
    y0, x0 = int(y), int(x)
    y1, x1 = min(y0 + 1, height - 1), min(x0 + 1, width - 1)
    fy, fx = y - y0, x - x0
    image = rgb.astype(np.float64)
    top = image[y0, x0] * (1 - fx) + image[y0, x1] * fx
    bottom = image[y1, x0] * (1 - fx) + image[y1, x1] * fx
    value: np.ndarray = top * (1 - fy) + bottom * fy
    return value


@pytest.mark.parametrize(("height", "width"), [(480, 640), (640, 480), (200, 200), (720, 1280)])
def test_pixels_are_bilinear_samples_of_four_neighbours_rounded_to_levels(height: int, width: int) -> None:
    rgb = camera_image(height, width)
    image = preprocess(rgb, 256)
    assert image.shape == (256, 256, 3)
    assert image.dtype == np.float32
    levels = image * 255
    assert np.abs(levels - np.rint(levels)).max() < 1e-4
    for row, column in [(0, 0), (255, 255), (17, 200), (128, 128), (99, 3)]:
        assert np.abs(levels[row, column] - by_hand(rgb, 256, row, column)).max() <= 0.501


def test_the_crop_of_a_640_by_480_image_begins_at_column_42_of_341() -> None:
    rgb = np.zeros((480, 640, 3), np.uint8)
    rgb[:, : int(42 * 640 / 341)] = 255
    bright = preprocess(rgb, 256)[128, :, 0]
    assert bright[0] < 0.5
    assert preprocess(rgb[:, ::-1].copy(), 256)[128, -1, 0] < 0.5


def test_pixels_do_not_depend_on_threads_and_equal_pytorchs_resizer(recording: Recording) -> None:
    rgb = recording.frames[0]
    image = preprocess(rgb, 256)
    threads = torch.get_num_threads()
    levels = []
    for count in (1, 2):
        torch.set_num_threads(count)
        resized = torch.nn.functional.interpolate(
            torch.from_numpy(rgb).permute(2, 0, 1)[None].float(), size=(256, 341), mode="bilinear"
        )
        levels.append(resized[0, :, :, 42:298].round().permute(1, 2, 0).numpy())
    torch.set_num_threads(threads)
    off = [int((np.abs(np.rint(image * 255) - level) > 0).sum()) for level in levels]
    assert max(off) <= 20, "PyTorch itself rounds a few of 196,608 numbers differently with another number of threads"
    assert max(np.abs(np.rint(image * 255) - level).max() for level in levels) <= 1


def test_antialiasing_would_be_noticed() -> None:
    rgb = camera_image(480, 640)
    smooth = torch.nn.functional.interpolate(
        torch.from_numpy(rgb).permute(2, 0, 1)[None].float(), size=(256, 341), mode="bilinear", antialias=True
    )[0, :, :, 42:298]
    assert np.abs(preprocess(rgb, 256) - smooth.permute(1, 2, 0).numpy() / 255).max() > 0.1


def test_an_image_of_the_right_size_stays_as_it_is() -> None:
    rgb = camera_image(256, 256)
    np.testing.assert_array_equal(np.rint(preprocess(rgb, 256) * 255), rgb)


def test_the_augmentation_stays_in_range_and_follows_from_its_seed() -> None:
    image = preprocess(camera_image(480, 640), 256)
    once, again = (augment(image, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(once, again)
    assert once.shape == image.shape
    assert once.dtype == np.float32
    assert once.min() >= 0
    assert once.max() <= 1
    assert not np.array_equal(once, augment(image, np.random.default_rng(8)))


def test_the_augmentation_shifts_by_at_most_sixteen_pixels() -> None:
    image = np.zeros((256, 256, 3), np.float32)
    image[128, 128] = 1
    random = np.random.default_rng(2)
    seen = []
    for _ in range(40):
        row, column = np.unravel_index(augment(image, random).sum(axis=2).argmax(), (256, 256))
        seen.append((int(row) - 128, int(column) - 128))
    assert max(abs(shift) for pair in seen for shift in pair) <= 16
    assert len(set(seen)) > 20
