import numpy as np
import pytest

from vsnbench.values.encoding.image_digest import Pixels, compare_digests, depth_digest, rgb_digest

COUNTED = (np.arange(6144) % 251).astype(np.uint8)
"""The input of BLAKE3's published test vectors: 0, 1, ..., 250, 0, 1, ..."""
OF_6144_BYTES = "blake3:3e2e5b74e048f3add6d21faab3f83aa44d3b2278afb83b80b3c35164ebeca205"
OF_4096_BYTES = "blake3:015094013f57a5277b59d8475c0501042c0b642e531b0a1c8f58d2163229e969"
"""Published digests by number of bytes."""


def test_the_digest_of_a_colour_image_is_of_its_bytes_row_by_row_red_first() -> None:
    rgb = COUNTED.reshape(32, 64, 3)
    assert rgb_digest(rgb) == OF_6144_BYTES
    assert rgb_digest(np.asfortranarray(rgb)) == OF_6144_BYTES
    assert rgb_digest(np.repeat(rgb, 2, axis=1)[:, ::2]) == OF_6144_BYTES
    assert rgb_digest(rgb[..., ::-1]) != OF_6144_BYTES


def test_the_digest_of_a_depth_image_is_of_its_millimetres_the_low_byte_first() -> None:
    low_first = COUNTED[:4096].view("<u2").reshape(32, 64)
    assert depth_digest(low_first.astype(np.uint16)) == OF_4096_BYTES
    assert depth_digest(low_first.astype(">u2")) == OF_4096_BYTES
    assert depth_digest(low_first.byteswap()) != OF_4096_BYTES


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ("blake3:01", "blake3:01", Pixels.SAME),
        ("sha256:01", "sha256:01", Pixels.SAME),
        (None, None, Pixels.SAME),
        ("blake3:01", "blake3:02", Pixels.OTHER),
        ("blake3:01", None, Pixels.OTHER),
        (None, "sha256:01", Pixels.OTHER),
        ("blake3:01", "sha256:01", Pixels.NOT_COMPARABLE),
        ("sha256:02", "blake3:01", Pixels.NOT_COMPARABLE),
    ],
)
def test_two_digests_say_something_of_their_images_only_when_made_alike(
    one: str | None, other: str | None, said: Pixels
) -> None:
    assert compare_digests(one, other) is said
