"""Every changed byte of an image file is found by the digest of the file."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.results.files.test_images import look
from vsnbench.results.files import image_set
from vsnbench.results.files.image_set import Damage, image_faults
from vsnbench.results.files.images import EpisodeImages, depth_path, rgb_path
from vsnbench.values.encoding.image_digest import StepDigests


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("episode")


@pytest.fixture(scope="module")
def digests(directory: Path) -> StepDigests:
    written = EpisodeImages(directory).write(1, look())
    return StepDigests(1, written.rgb_digest, written.depth_digest, *written.file_digests)


@given(st.booleans(), st.floats(0, 1, exclude_max=True), st.integers(1, 255))
def test_a_flipped_byte_anywhere_in_an_image_file_is_found(
    directory: Path, digests: StepDigests, is_depth: bool, place: float, flip: int
) -> None:
    file = depth_path(directory, 1) if is_depth else rgb_path(directory, 1)
    content = bytearray(file.read_bytes())
    intact = bytes(content)
    content[int(place * len(content))] ^= flip
    file.write_bytes(content)
    try:
        (fault,) = image_faults(directory, [digests], read=True)
    finally:
        file.write_bytes(intact)
    assert directory / fault.file == file
    assert fault.damage in (Damage.OTHER_BYTES, Damage.INCOMPLETE)
    assert image_faults(directory, [digests], read=True) == []


def test_a_step_from_before_file_digests_is_checked_by_its_pixels(directory: Path, digests: StepDigests) -> None:
    older = StepDigests(1, digests.rgb, digests.depth)
    assert image_faults(directory, [older], read=True) == []


def test_files_with_the_bytes_that_were_written_are_decoded_only_on_request(
    directory: Path, digests: StepDigests, monkeypatch: pytest.MonkeyPatch
) -> None:
    contradicted = replace(digests, depth=digests.rgb)
    (fault,) = image_faults(directory, [contradicted], read=True, decode=True)
    assert fault.damage is Damage.OTHER_PIXELS
    monkeypatch.setattr(image_set, "decode_picture", lambda *_: None)
    assert image_faults(directory, [digests], read=True) == []
    older = StepDigests(1, digests.rgb, digests.depth)
    assert {fault.damage for fault in image_faults(directory, [older], read=True)} == {Damage.UNDECODABLE}
