"""A small room as a mesh, for tests of scans."""

import numpy as np

from vsnbench.simulator.rendering.scan.mesh import ScanMesh

SIZE_M = (4.0, 3.0, 2.5)
_SIDES = {
    "floor": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
    "ceiling": [(0, 1, 1), (1, 1, 1), (1, 0, 1), (0, 0, 1)],
    "south": [(0, 0, 1), (1, 0, 1), (1, 0, 0), (0, 0, 0)],
    "north": [(1, 1, 1), (0, 1, 1), (0, 1, 0), (1, 1, 0)],
    "west": [(0, 1, 1), (0, 0, 1), (0, 0, 0), (0, 1, 0)],
    "east": [(1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 0, 0)],
}
TABLE_M = (1.0, 0.8, 1.8, 1.4, 0.75)
"""x and y of two corners, and height."""


def room(*, without: tuple[str, ...] = (), table: bool = False, textured: bool = True) -> ScanMesh:
    """Return a room with its corner at (0, 0, 0); each side has two triangles and the whole texture."""
    quads = [np.array(corners) * SIZE_M for name, corners in _SIDES.items() if name not in without]
    if table:
        x0, y0, x1, y1, z = TABLE_M
        quads.append(np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]))
        for (xa, ya), (xb, yb) in (
            ((x0, y0), (x1, y0)),
            ((x1, y0), (x1, y1)),
            ((x1, y1), (x0, y1)),
            ((x0, y1), (x0, y0)),
        ):
            quads.append(np.array([(xa, ya, 0), (xb, yb, 0), (xb, yb, z), (xa, ya, z)]))
    return of_quads(np.array(quads, float), textured=textured)


def of_quads(quads: np.ndarray, *, textured: bool = True) -> ScanMesh:
    """Return (N, 4, 3) quads as a mesh."""
    count = len(quads)
    first = np.arange(count)[:, None] * 4
    faces = (first[:, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    uv = np.tile(np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)], np.float32), (count, 1)).reshape(-1, 3, 2)
    colors = np.tile(np.array([(200, 40, 40), (40, 200, 40), (40, 40, 200), (200, 200, 40)], np.uint8), (count, 1))
    texture = np.full(2 * count, 0 if textured else -1, np.int32)
    return ScanMesh(
        quads.reshape(-1, 3).astype(np.float32), faces, colors, texture, uv, (checkers(),) if textured else ()
    )


def checkers(side: int = 256, square: int = 32) -> np.ndarray:
    """Return a texture of red and blue squares, the upper left one red."""
    row, column = np.indices((side, side)) // square
    red = (row + column) % 2 == 0
    return np.where(red[..., None], (220, 30, 30), (30, 30, 220)).astype(np.uint8)
