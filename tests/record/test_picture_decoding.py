import struct
import zlib

import cv2
import numpy as np
import pytest

from vsnbench.record.picture_decoding import MOST_PIXELS, decode_picture, picture_size

PICTURE = np.random.default_rng(0).integers(0, 255, (30, 47, 3), np.uint8)


def encoded(suffix: str, *options: int) -> bytes:
    return bytes(cv2.imencode(suffix, PICTURE, options)[1])


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_what_is_a_picture_is_decoded(suffix: str) -> None:
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
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    rows = zlib.compress(bytes(side + 1) * side, 9)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    assert len(bomb) < MOST_PIXELS / 10
    assert picture_size(bomb) == (side, side)
    assert decode_picture(bomb, cv2.IMREAD_COLOR) is None


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM" + bytes(60), b"\xff\xd8\xff\xe0\0\0"]
)
def test_what_is_none_is_said_so(content: bytes) -> None:
    assert decode_picture(content, cv2.IMREAD_COLOR) is None
