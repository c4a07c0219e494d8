"""Image messages become numpy arrays, whatever way a driver lays them out."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.sensing.image_decoding import ImageError, decode_color, decode_depth, decode_labels


@dataclass
class Image:
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: bytes


def message(pixels: np.ndarray, encoding: str, *, padding: int = 0, big_endian: bool = False) -> Image:
    height, width = pixels.shape[:2]
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big_endian else "<"))
    rows = [row.tobytes() + b"\xaa" * padding for row in stored]
    return Image(height, width, encoding, int(big_endian), len(rows[0]), b"".join(rows))


RGB = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)


@pytest.mark.parametrize("padding", [0, 5])
def test_colour_comes_out_as_rgb_whatever_the_order_in_the_message(padding: int) -> None:
    alpha = np.full((2, 3, 1), 255, np.uint8)
    assert np.array_equal(decode_color(message(RGB, "rgb8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(RGB[..., ::-1], "bgr8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(np.dstack([RGB, alpha]), "rgba8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(np.dstack([RGB[..., ::-1], alpha]), "bgra8", padding=padding)), RGB)


def test_a_grey_image_has_three_equal_channels() -> None:
    grey = RGB[..., 0]
    assert np.array_equal(decode_color(message(grey, "mono8")), np.dstack([grey] * 3))


@settings(deadline=None, max_examples=60)
@given(
    height=st.integers(1, 5),
    width=st.integers(1, 7),
    padding=st.integers(0, 9),
    big_endian=st.booleans(),
    kind=st.sampled_from([("16UC1", np.uint16), ("mono16", np.uint16), ("32FC1", np.float32)]),
)
def test_depth_survives_padding_and_byte_order(height, width, padding, big_endian, kind) -> None:
    encoding, dtype = kind
    pixels = (np.arange(height * width).reshape(height, width) * 257 % 60000).astype(dtype)
    depth = decode_depth(message(pixels, encoding, padding=padding, big_endian=big_endian))
    assert depth.dtype == dtype
    assert np.array_equal(depth, pixels)


def test_the_last_row_may_come_without_its_padding() -> None:
    image = message(np.array([[1, 2], [3, 4]], np.uint16), "16UC1", padding=4)
    image.data = image.data[:-4]
    assert decode_depth(image).tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(("encoding", "dtype"), [("16UC1", np.uint16), ("32SC1", np.int32)])
def test_instance_labels_are_whole_numbers_of_either_width(encoding, dtype) -> None:
    labels = decode_labels(message(np.array([[0, 7], [1, 65535]], dtype), encoding))
    assert labels.dtype == np.int32
    assert labels.tolist() == [[0, 7], [1, 65535]]


def test_an_unknown_encoding_is_named() -> None:
    with pytest.raises(ImageError, match="'yuv422', not rgb8"):
        decode_color(message(RGB, "yuv422"))
    with pytest.raises(ImageError, match="'rgb8', not 16UC1"):
        decode_depth(message(RGB, "rgb8"))
    with pytest.raises(ImageError, match="'rgb8', not 16UC1, 32SC1"):
        decode_labels(message(RGB, "rgb8"))


def test_a_message_with_too_few_bytes_is_refused() -> None:
    image = message(RGB, "rgb8")
    image.data = image.data[:-1]
    with pytest.raises(ImageError, match="has 17 bytes, not 18"):
        decode_color(image)


def test_a_step_that_cannot_hold_a_row_is_refused() -> None:
    image = message(RGB, "rgb8")
    image.step = 8
    with pytest.raises(ImageError, match="rows of 8 bytes, not 9"):
        decode_color(image)


def test_an_empty_image_is_refused() -> None:
    with pytest.raises(ImageError, match="0x0"):
        decode_color(Image(0, 0, "rgb8", 0, 0, b""))
