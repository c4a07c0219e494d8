"""Level, scale and axes of a scan, and scans that cannot be aligned."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulator.scan.rooms import SIZE_M, of_quads, room
from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.scan.alignment import align_scan


def turned(mesh: ScanMesh, matrix: np.ndarray, scale: float = 1.0) -> ScanMesh:
    return replace(mesh, vertices=(mesh.vertices @ matrix.T * scale).astype(np.float32))


def about(axis: int, degrees: float) -> np.ndarray:
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.eye(3)
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    matrix[a, a] = matrix[b, b] = cos
    matrix[a, b], matrix[b, a] = -sin, sin
    return matrix


def test_a_tilted_scan_in_another_frame_and_unit_is_levelled_and_turned_to_the_axes() -> None:
    y_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    raw = turned(room(table=True), y_up @ about(0, 4) @ about(1, -3) @ about(2, 25), 100.0)
    aligned, transformation = align_scan(raw, "y", 0.01)
    assert np.allclose(aligned.vertices.max(axis=0), SIZE_M, atol=2e-3)
    assert np.allclose(aligned.vertices.min(axis=0), 0, atol=2e-3)
    homogeneous = np.column_stack([raw.vertices, np.ones(len(raw.vertices))])
    assert np.allclose((homogeneous @ transformation.T)[:, :3], aligned.vertices, atol=1e-4)


def hall() -> ScanMesh:
    """Return a room of 12 x 9 x 2.5 m."""
    return turned(room(), np.diag([3.0, 3.0, 1.0]))


def upper_storey() -> ScanMesh:
    low, high = room(table=True), room(table=True)
    vertices = np.concatenate([low.vertices, high.vertices + np.array([0, 0, 2.8])]).astype(np.float32)
    values = {name: np.concatenate([getattr(low, name)] * 2) for name in ("colors", "texture", "uv")}
    return replace(low, vertices=vertices, faces=np.concatenate([low.faces, high.faces + len(low.vertices)]), **values)


@pytest.mark.parametrize(
    ("mesh", "up", "code", "words"),
    [
        (turned(room(), np.eye(3), 1000), "z", "scan-scale", "--unit mm"),
        (turned(hall(), about(0, 90)), "z", "scan-scale", "--up y"),
        (turned(room(), np.eye(3), 0.013), "z", "scan-scale", "--length"),
        (turned(room(table=True), about(0, 180)), "z", "scan-upside-down", "--up -z"),
        (room(without=("floor", "ceiling")), "z", "scan-no-floor", "scan the floor"),
        (upper_storey(), "z", "scan-storeys", "two storeys"),
        (of_quads(np.array([[(0, 0, 0), (3, 0, 0), (3, 0, 2), (0, 0, 2)]], float)), "z", "scan-no-floor", "--up"),
    ],
    ids=["millimetres", "another axis", "no scale", "upside down", "no floor", "two storeys", "one wall"],
)
def test_a_scan_that_cannot_be_aligned_is_refused_with_the_next_step(
    mesh: ScanMesh, up: str, code: str, words: str
) -> None:
    with pytest.raises(SiteError) as refused:
        align_scan(mesh, up, 1.0)
    assert refused.value.code == code
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
