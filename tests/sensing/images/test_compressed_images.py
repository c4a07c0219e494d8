"""Compressed images are decoded; other codecs and damaged data are errors of one line."""

import struct
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.errors import ImageError
from vsnbench.sensing.images.camera_images import decode_color, decode_depth
from vsnbench.sensing.images.compressed_images import is_compressed

RED = np.full((8, 12, 3), (250, 10, 20), np.uint8)
DEPTH_MM = np.arange(96, dtype=np.uint16).reshape(8, 12) * 40


def message(codec: str, data: bytes) -> Any:
    return SimpleNamespace(format=codec, data=data)


def encoded(pixels: Any, ending: str) -> bytes:
    done, data = cv2.imencode(ending, pixels)
    assert done
    return bytes(data)


@pytest.mark.parametrize(
    ("codec", "ending", "order"),
    [
        ("rgb8; jpeg compressed bgr8", ".jpg", -1),
        ("jpeg", ".jpg", -1),
        ("bgr8; png compressed bgr8", ".png", -1),
        ("rgb8; jpeg compressed rgb8", ".jpg", 1),
    ],
)
def test_colours_survive_compression(codec: str, ending: str, order: int) -> None:
    pixels = decode_color(message(codec, encoded(RED[..., ::order], ending)))
    assert pixels.shape == (8, 12, 3)
    assert np.abs(pixels.astype(int) - RED).max() < 12


def test_a_grey_image_has_three_channels() -> None:
    pixels = decode_color(message("mono8; png compressed mono8", encoded(RED[..., 0], ".png")))
    assert pixels[0, 0].tolist() == [250] * 3


@pytest.mark.parametrize("codec", ["16UC1; compressedDepth", "16UC1; compressedDepth png"])
def test_millimetres_are_exact(codec: str) -> None:
    data = struct.pack("<iff", 0, 0.0, 0.0) + encoded(DEPTH_MM, ".png")
    assert np.array_equal(decode_depth(message(codec, data)), DEPTH_MM)
    assert np.array_equal(decode_depth(message("16UC1; png compressed ", encoded(DEPTH_MM, ".png"))), DEPTH_MM)


@given(st.floats(0.4, 9.5))
def test_inverse_depth_is_within_its_quantization(depth_m: float) -> None:
    # The defaults of compressed_depth_image_transport: depth_max 10, depth_quantization 100.
    a = 100.0 * 101.0
    b = 1.0 - a / 10.0
    value = np.array([[round(a / depth_m + b), 0]], np.uint16)
    data = struct.pack("<iff", 0, a, b) + encoded(value, ".png")
    found = decode_depth(message("32FC1; compressedDepth png", data))
    assert found[0, 0] == pytest.approx(depth_m, abs=depth_m**2 / a)
    assert np.isnan(found[0, 1])


@pytest.mark.parametrize(
    ("codec", "data"),
    [
        ("rgb8; theora", b"OggS"),
        ("h264", b"\0\0\0\1"),
        ("16UC1; compressedDepth rvl", struct.pack("<iff", 0, 0, 0) + b"\1\2\3\4"),
        ("16UC1; compressedDepth png", b""),
        ("32FC1; png compressed", encoded(DEPTH_MM, ".png")),
        ("16UC1; compressedDepth png", struct.pack("<iff", 0, 0, 0) + encoded(RED, ".png")),
        ("jpeg", b"\xff\xd8\xffbroken"),
        ("", b""),
    ],
)
def test_another_codec_is_one_line(codec: str, data: bytes) -> None:
    decode = decode_depth if "UC1" in codec or "FC1" in codec else decode_color
    with pytest.raises(ImageError) as refused:
        decode(message(codec, data))
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("topic", "compressed"),
    [("/camera/color/image_raw", False), ("/camera/color/image_raw/compressed", True), ("depth/compressedDepth", True)],
)
def test_the_name_of_the_topic_tells_whether_it_is_compressed(topic: str, compressed: bool) -> None:
    assert is_compressed(topic) is compressed
