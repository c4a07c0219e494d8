import struct
import zlib

import cv2
import numpy as np
import pytest

from vsnbench.values.encoding.images import (
    MOST_PIXELS,
    decode_picture,
    depth_millimetres,
    encode_depth_png,
    encode_jpeg,
    picture_size,
)

PICTURE = np.random.default_rng(0).integers(0, 255, (30, 47, 3), np.uint8)


def encoded(suffix: str, *options: int) -> bytes:
    return bytes(cv2.imencode(suffix, PICTURE, options)[1])


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_images_are_decoded(suffix: str) -> None:
    assert picture_size(encoded(suffix)) == (47, 30)
    pixels = decode_picture(encoded(suffix), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert np.array_equal(pixels, cv2.imdecode(np.frombuffer(encoded(suffix), np.uint8), cv2.IMREAD_COLOR))


def test_progressive_jpeg_has_its_size_too() -> None:
    assert picture_size(encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1)) == (47, 30)


def test_a_small_file_that_claims_a_huge_picture_is_not_unpacked() -> None:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    side = 30_000
    header = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)  # one bit a pixel
    rows = zlib.compress(bytes(side // 8 + 1) * side, 9)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    assert len(bomb) < MOST_PIXELS / 10
    assert picture_size(bomb) == (side, side)
    assert decode_picture(bomb, cv2.IMREAD_COLOR) is None


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM" + bytes(60), b"\xff\xd8\xff\xe0\0\0"]
)
def test_other_content_is_not_decoded(content: bytes) -> None:
    assert decode_picture(content, cv2.IMREAD_COLOR) is None


@pytest.mark.parametrize(
    ("metres", "millimetres"),
    [(np.nan, 0), (0.0, 0), (-1.0, 0), (np.inf, 0), (1.2344, 1234), (65.535, 65535), (65.6, 0), (0.0004, 0)],
)
def test_depth_becomes_millimetres_with_zero_for_invalid(metres: float, millimetres: int) -> None:
    assert depth_millimetres(np.array([[metres]], np.float32))[0, 0] == millimetres


def test_depth_comes_back_exactly_and_colours_nearly() -> None:
    millimetres = np.random.default_rng(1).integers(0, 65535, (30, 47), np.uint16)
    depth = decode_picture(encode_depth_png(millimetres), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    assert np.array_equal(depth, millimetres)
    smooth = cv2.GaussianBlur(PICTURE, (0, 0), 6)
    colours = decode_picture(encode_jpeg(smooth), cv2.IMREAD_COLOR)
    assert colours is not None
    assert np.abs(colours[..., ::-1].astype(int) - smooth).mean() < 3
