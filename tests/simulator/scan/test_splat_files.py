"""Splats of PLY and SPZ files: those of several writers are read; broken ones are refused with the next step."""

import gzip
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.simulator.scan.made_scans import splats_of, write_splats
from tests.simulator.scan.rooms import SIZE_M, room
from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import parse_scan
from vsnbench.simulator.scan.alignment import align_scan
from vsnbench.simulator.scan.reading import read_scan, usual_up


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the same splats as .ply and as .spz of versions 2 and 3."""
    folder = tmp_path_factory.mktemp("splats")
    splats = splats_of(room(table=True), 20)
    write_splats(splats, folder / "room.ply")
    for version in (2, 3):
        write_splats(splats, folder / f"room{version}.spz", version=version)
    return folder


def test_all_kinds_of_files_have_the_same_splats(made: Path) -> None:
    ply, *others = (read_scan(made / name).splats for name in ("room.ply", "room2.spz", "room3.spz"))
    assert ply is not None
    for other in others:
        assert other is not None
        assert np.abs(other.centres - ply.centres).max() < 2e-4
        assert np.abs(other.paint.astype(int) - ply.paint).max() <= 4
        wide = np.sqrt(np.abs(ply.spreads[:, [0, 3, 5]]).max())
        assert np.abs(
            np.sqrt(np.abs(other.spreads[:, [0, 3, 5]])) - np.sqrt(np.abs(ply.spreads[:, [0, 3, 5]]))
        ).max() < (0.05 * wide)


def test_the_axis_that_points_up_is_that_of_the_kind_of_file(made: Path, tmp_path: Path) -> None:
    assert usual_up(made / "room.ply", read_scan(made / "room.ply")) == "-y"
    assert usual_up(made / "room3.spz", read_scan(made / "room3.spz")) == "y"
    assert usual_up(Path("room.ply"), room()) == "z"


def test_surfaces_of_splats_are_levelled_like_triangles(made: Path) -> None:
    scan, _ = align_scan(read_scan(made / "room3.spz"), "z", 1.0)
    assert scan.splats is not None
    corners = scan.corners.reshape(-1, 3)
    for places in (corners, scan.splats.centres):
        assert np.allclose(np.percentile(places, 99.5, axis=0), SIZE_M, atol=0.05)
        assert np.allclose(np.percentile(places, 0.5, axis=0), 0, atol=0.05)
    floor = corners[(corners[:, 2] < 0.1)]
    assert abs(float(floor[:, 2].mean())) < 0.01


def test_the_site_s_file_keeps_the_splats(made: Path, tmp_path: Path) -> None:
    scan = read_scan(made / "room3.spz")
    scan.write(tmp_path / "room.scan.npz")
    again = parse_scan((tmp_path / "room.scan.npz").read_bytes(), "room")
    assert scan.splats is not None
    assert again.splats is not None
    for name in ("centres", "spreads", "paint"):
        assert np.array_equal(getattr(scan.splats, name), getattr(again.splats, name))


def ply_with(old: str, new: str) -> Callable[[Path], bytes]:
    def change(made: Path) -> bytes:
        data = (made / "room.ply").read_bytes()
        assert old.encode() in data
        return data.replace(old.encode(), new.encode(), 1)

    return change


def spz_of(content: bytes) -> Callable[[Path], bytes]:
    return lambda _made: gzip.compress(content)


def header(version: int = 3, count: int = 1, degree: int = 0, fraction: int = 12) -> bytes:
    return struct.pack("<IIIBBBB", 0x5053474E, version, count, degree, fraction, 0, 0)


ONE = struct.pack("<9x") + b"\xff" + b"\x80" * 3 + b"\xa0" * 3
BROKEN = [
    ("ply", ply_with("opacity", "opazity"), "invalid-scan", "no opacity"),
    ("ply", ply_with("rot_3", "rot_9"), "invalid-scan", "no rot_3"),
    ("ply", ply_with("binary_little_endian", "ascii"), "invalid-scan", "plain binary"),
    ("ply", ply_with("property float nx", "property list uchar int nx"), "invalid-scan", "property list"),
    ("ply", ply_with("float nx", "quad nx"), "invalid-scan", "quad"),
    ("ply", ply_with("property float nx", "property uint packed_position"), "invalid-scan", "compressed"),
    ("ply", ply_with("element vertex ", "element vertex 9999"), "scan-too-large", "crop"),
    ("ply", lambda made: (made / "room.ply").read_bytes()[:-9], "invalid-scan", "promises more"),
    ("spz", lambda _made: b"NGSP" + bytes(40), "invalid-scan", "version 4"),
    ("spz", lambda _made: b"", "invalid-scan", "not an SPZ"),
    ("spz", lambda _made: b"no gzip at all", "invalid-scan", "decompressed"),
    ("spz", spz_of(bytes(16)), "invalid-scan", "version 2 or 3"),
    ("spz", spz_of(header(count=2**31)), "scan-too-large", "crop"),
    ("spz", spz_of(header(count=0)), "invalid-scan", "no splats"),
    ("spz", spz_of(header(count=1_000_000) + bytes(100)), "invalid-scan", "promises more"),
    ("spz", spz_of(header() + ONE.replace(b"\xff", b"\x00") + bytes(4)), "invalid-scan", "transparent"),
]


@pytest.mark.parametrize(("suffix", "content", "code", "words"), BROKEN, ids=[words for *_, words in BROKEN])
def test_broken_splats_are_refused_with_the_next_step(
    suffix: str, content: Callable[[Path], bytes], code: str, words: str, made: Path, tmp_path: Path
) -> None:
    path = tmp_path / f"room.{suffix}"
    path.write_bytes(content(made))
    with pytest.raises(SiteError) as refused:
        read_scan(path)
    assert refused.value.code == code
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_only_what_is_needed_is_decompressed(made: Path, tmp_path: Path) -> None:
    path = tmp_path / "room.spz"
    path.write_bytes(gzip.compress(header() + ONE + bytes(4) + bytes(300_000_000), 1))
    with pytest.raises(SiteError):  # one splat is too little for a surface, or a floor
        align_scan(read_scan(path), "y", 1.0)
