"""The file of a scan: what was written is read, and nothing else."""

import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.simulator.scan.rooms import room
from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import load_scan, parse_scan


def content(**changes: Any) -> bytes:
    """Return the file of a room, with other arrays."""
    mesh = room()
    arrays: dict[str, Any] = {name: getattr(mesh, name) for name in ("vertices", "faces", "colors", "texture", "uv")}
    stream = io.BytesIO()
    np.savez(stream, **(arrays | changes))
    return stream.getvalue()


def test_a_scan_is_read_as_it_was_written_and_known_by_its_hash(tmp_path: Path) -> None:
    mesh, path = room(table=True), tmp_path / "room.scan.npz"
    sha256 = mesh.write(path)
    assert sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert room(table=True).write(tmp_path / "again.npz") == sha256
    read = load_scan(path, sha256)
    for name in ("vertices", "faces", "colors", "texture", "uv"):
        assert np.array_equal(getattr(read, name), getattr(mesh, name))
    assert np.array_equal(read.textures[0], mesh.textures[0])


def test_another_file_under_the_name_of_a_scan_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "room.scan.npz"
    sha256 = room().write(path)
    room(table=True).write(path)
    with pytest.raises(SiteError) as refused:
        load_scan(path, sha256)
    assert refused.value.code == "scan-changed"


@pytest.mark.parametrize(
    "changes",
    [
        {
            "faces": np.full((4, 3), 10**6, np.int32),
            "texture": np.full(4, -1, np.int32),
            "uv": np.zeros((4, 3, 2), "f4"),
        },
        {"vertices": np.full((24, 3), np.nan, np.float32)},
        {"texture": np.full(12, 3, np.int32)},
        {"colors": np.zeros((3, 3), np.uint8)},
        {"faces": np.zeros((0, 3), np.int32), "texture": np.zeros(0, np.int32), "uv": np.zeros((0, 3, 2), np.float32)},
        {"vertices": np.zeros((24, 3), np.float64)},
        {"vertices": np.array([object()])},
    ],
    ids=["vertex", "nan", "texture", "lengths", "empty", "type", "object"],
)
def test_invalid_arrays_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(SiteError) as refused:
        parse_scan(content(**changes), "room")
    assert refused.value.code == "invalid-scan"


def test_an_array_that_promises_terabytes_is_refused_before_memory_is_taken() -> None:
    header = b"\x93NUMPY\x01\x00\x76\x00" + b"{'descr': '<f4', 'fortran_order': False, 'shape': (999999999999, 3), }"
    with zipfile.ZipFile(stream := io.BytesIO(), "w") as archive:
        for name in ("vertices", "faces", "colors", "texture", "uv"):
            archive.writestr(f"{name}.npy", header.ljust(127) + b"\n")
    with pytest.raises(SiteError) as refused:
        parse_scan(stream.getvalue(), "room")
    assert refused.value.code == "invalid-scan"


def test_a_compressed_archive_is_refused() -> None:
    with zipfile.ZipFile(stream := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("vertices.npy", bytes(10**6))
    with pytest.raises(SiteError) as refused:
        parse_scan(stream.getvalue(), "room")
    assert refused.value.code == "invalid-scan"
