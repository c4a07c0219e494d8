"""Files of scanning apps: those of several writers are read; broken and hostile ones are refused with the next step."""

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from tests.simulator.scan.made_scans import write_scan
from tests.simulator.scan.rooms import room
from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.scan.reading import read_scan

trimesh = pytest.importorskip("trimesh")


def written(folder: Path, suffix: str) -> Path:
    path = folder / f"room.{suffix}"
    write_scan(room(table=True), path)
    return path


def surfaces(mesh: ScanMesh) -> list[list[float]]:
    return sorted(np.round(mesh.corners.mean(axis=1), 3).tolist())


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply"])
def test_what_was_exported_is_read(suffix: str, tmp_path: Path) -> None:
    mesh = read_scan(written(tmp_path, suffix))
    assert surfaces(mesh) == surfaces(room(table=True))
    if suffix != "ply":
        assert np.array_equal(mesh.textures[0], room().textures[0])
        first = mesh.corners[0].tolist()
        assert [corner in room(table=True).corners.reshape(-1, 3).tolist() for corner in first] == [True] * 3


def test_a_ply_of_another_writer_is_read(tmp_path: Path) -> None:
    """As RTAB-Map and PCL write it: big-endian doubles, colours, and other elements."""
    path = tmp_path / "room.ply"
    header = (
        "ply\nformat binary_big_endian 1.0\ncomment PCL generated\nelement vertex 3\nproperty double x\n"
        "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = [((0, 0, 0), (255, 0, 0)), ((1, 0, 0), (0, 255, 0)), ((0, 1, 0), (0, 0, 255))]
    body = b"".join(struct.pack(">3d3B", *point, *color) for point, color in rows)
    path.write_bytes(header.encode() + body + struct.pack(">B3i", 3, 0, 1, 2))
    mesh = read_scan(path)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.colors.tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255]]


WITHOUT_A_VERTEX = (
    "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"
)


def refused(path: Path) -> SiteError:
    with pytest.raises(SiteError) as caught:
        read_scan(path)
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (b"", "invalid-scan", "no PLY header"),
        (b"ply\n" + b"comment x\n" * 1_000_000 + b"end_header\n", "invalid-scan", "no PLY header within"),
        ("element vertex 900000000000\nelement face 1\nend_header\n", "scan-too-large", "decimate"),
        ("element vertex 3\nproperty float x\nelement face 20000000\nend_header\n", "scan-too-large", "20,000,000"),
        (
            "element vertex 100000\nproperty float x\nelement face 1\nend_header\n1 2 3\n",
            "invalid-scan",
            "promises more",
        ),
        ("element vertex 9\nproperty float f_dc_0\nend_header\n", "invalid-scan", "not plain binary"),
        ("element vertex 9\nproperty quad x\nelement face 1\nend_header\n", "invalid-scan", "type 'quad'"),
        ("element vertex -3\nelement face 1\nend_header\n", "invalid-scan", "element vertex -3"),
        (WITHOUT_A_VERTEX, "invalid-scan", "export it again"),
        ("comment TextureFile ../x.png\nelement vertex 1\nelement face 1\nend_header\n", "scan-texture", "outside"),
        ("comment TextureFile x.png\nelement vertex 1\nelement face 1\nend_header\n", "scan-texture", "x.png"),
    ],
)
def test_a_broken_ply_is_refused_with_the_next_step(
    content: str | bytes, code: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "room.ply"
    text = f"ply\nformat ascii 1.0\n{content}".encode() if isinstance(content, str) else content
    path.write_bytes(text)
    error = refused(path)
    assert error.code == code
    assert words in str(error)


def glb_with(path: Path, **changes: object) -> None:
    """Change values of a GLB file's description, by their paths."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    described = json.loads(data[20 : 20 + length])
    for name, value in changes.items():
        *parents, last = [int(part) if part.isdigit() else part for part in name.split("__")]
        place = described
        for part in parents:
            place = place[part]
        place[last] = value
    text = json.dumps(described).encode()
    text += b" " * (-len(text) % 4)
    body = data[20 + length :]
    path.write_bytes(
        struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(body), len(text), 0x4E4F534A) + text + body
    )


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "scan-compressed", "Draco"),
        ({"extensionsUsed": ["KHR_texture_basisu"]}, "scan-compressed", "Basis"),
        ({"accessors__0__count": 60_000_000}, "invalid-scan", "promises more"),
        ({"accessors__0__bufferView": 99}, "invalid-scan", "accessor"),
        ({"accessors__0__count": -1}, "invalid-scan", "count"),
        ({"buffers__0__uri": "../secret.bin"}, "invalid-scan", "other files"),
        ({"images__0": {"uri": "http://192.0.2.1/a.png"}}, "invalid-scan", "other files"),
        ({"nodes__0__children": [0]}, "invalid-scan", "contain each other"),
        (
            {"nodes": [{"mesh": 0, "children": list(range(1, 90_000))}, *[{"mesh": 0}] * 89_999]},
            "scan-too-large",
            "join its parts",
        ),
        ({"meshes": "none"}, "invalid-scan", "meshes"),
        ({"bufferViews__0__byteStride": 10**9}, "invalid-scan", "export it again"),
    ],
)
def test_a_broken_glb_is_refused_with_the_next_step(
    changes: dict[str, object], code: str, words: str, tmp_path: Path
) -> None:
    path = written(tmp_path, "glb")
    glb_with(path, **changes)
    error = refused(path)
    assert error.code == code
    assert words in str(error)


def test_an_obj_may_name_only_files_in_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    path = written(folder, "obj")
    (material,) = folder.glob("*.mtl")
    text = material.read_text()
    name = text.split("map_Kd ")[1].split("\n")[0]
    shutil.copy(folder / name, tmp_path / "outside.png")
    for other in ("../outside.png", str(tmp_path / "outside.png"), "..\\outside.png"):
        material.write_text(text.replace(name, other))
        assert refused(path).code == "scan-texture"
    (folder / "link.png").symlink_to(tmp_path / "outside.png")
    material.write_text(text.replace(name, "link.png"))
    assert refused(path).code == "scan-texture"


def test_a_missing_texture_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, "obj")
    for picture in tmp_path.glob("*.png"):
        picture.unlink()
    error = refused(path)
    assert error.code == "scan-texture"
    assert ".png" in str(error)


def test_a_scan_of_an_unknown_kind_names_those_that_are_read(tmp_path: Path) -> None:
    (tmp_path / "room.usdz").write_bytes(b"")
    assert ".glb" in str(refused(tmp_path / "room.usdz"))


WRITTEN = Path(__file__).parent / "written"
"""The room without a table, and splats, as other programs wrote them.

pygltflib, glTF Transform (a texture, and a node with scale and translation), three.js (colours of vertices as numbers
from 0 to 1, with a material), plyfile, meshio and gsply.
"""


@pytest.mark.parametrize("name", ["pygltflib.glb", "gltf-transform.glb", "three.glb", "plyfile.ply", "meshio.ply"])
def test_meshes_of_other_writers_are_read(name: str) -> None:
    mesh = read_scan(WRITTEN / name)
    assert len(mesh.faces) == 12
    assert mesh.vertices.max(axis=0).tolist() == ([4.0, 2.5, 3.0] if name.endswith("glb") else [4.0, 3.0, 2.5])
    if name.endswith("ply"):
        assert mesh.colors.tolist() == [[200, 50, 50]] * 8
    if name == "three.glb":
        assert mesh.colors.tolist() == [[153, 8, 8]] * 36
    if name == "gltf-transform.glb":
        assert [picture.shape for picture in mesh.textures] == [(64, 64, 3)]
        assert mesh.textures[0][:8, :8].reshape(-1, 3).tolist() == [[220, 30, 30]] * 64


@pytest.mark.parametrize("name", ["gsply.ply", "gsply.spz"])
def test_splats_of_another_writer_are_read(name: str) -> None:
    splats = read_scan(WRITTEN / name).splats
    assert splats is not None
    assert len(splats.centres) == 24
    # A turn by 120 degrees about (1, 1, 1) takes x, y, z to y, z, x.
    assert np.sqrt(splats.spreads[:, [0, 3, 5]]) == pytest.approx(np.tile([0.01, 0.05, 0.1], (24, 1)), rel=0.04)
    assert splats.paint[:, 3].tolist() == pytest.approx([243] * 24, abs=1)
    assert splats.paint[:, :3].ravel().tolist() == pytest.approx([163] * 72, abs=2)
