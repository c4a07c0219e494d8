"""Rasterizer of a scan: draws triangles from both sides into a buffer of inverse depths, without hidden chunks.

Fast maths is off and it uses one thread, so that the same scan gives the same pixels on every machine.
"""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled
from vsnbench.simulator.rendering.raster import NEAR_M

CHUNK = 128
"""Triangles that are tested against the view together."""
TILE = 16
"""Side of the squares of pixels whose least inverse depth is known, to leave out hidden chunks."""


@compiled
def _bounds(eye: Any, axes: Any, focal: Any, centre_x: Any, centre_y: Any, box: Any, bounds: Any) -> None:
    """Write the first and last column and row that a box (2, 3) covers, and the largest inverse depth; with a margin.

    A box that reaches the near plane covers the image, and nothing hides it.
    """
    bounds[0] = bounds[2] = 1e9
    bounds[1] = bounds[3] = -1e9
    nearest = 1e9
    for k in range(8):
        px = box[k & 1, 0] - eye[0]
        py = box[(k >> 1) & 1, 1] - eye[1]
        pz = box[k >> 2, 2] - eye[2]
        z = axes[2, 0] * px + axes[2, 1] * py + axes[2, 2] * pz
        if z < 2.0 * NEAR_M:
            bounds[0] = bounds[2] = 0.0
            bounds[1] = bounds[3] = 1e9
            bounds[4] = 1e30
            return
        x = centre_x + focal * (axes[0, 0] * px + axes[0, 1] * py + axes[0, 2] * pz) / z
        y = centre_y + focal * (axes[1, 0] * px + axes[1, 1] * py + axes[1, 2] * pz) / z
        bounds[0], bounds[1] = min(bounds[0], x), max(bounds[1], x)
        bounds[2], bounds[3] = min(bounds[2], y), max(bounds[3], y)
        nearest = min(nearest, z)
    bounds[0] = min(max(bounds[0] - 1.0, 0.0), 1e9)
    bounds[2] = min(max(bounds[2] - 1.0, 0.0), 1e9)
    bounds[1] = min(max(bounds[1] + 1.0, -1.0), 1e9)
    bounds[3] = min(max(bounds[3] + 1.0, -1.0), 1e9)
    bounds[4] = 1.0001 / nearest + 1e-6


@compiled
def _is_hidden(nearness: Any, tiles: Any, y0: Any, y1: Any, x0: Any, x1: Any, most: Any) -> bool:
    """Whether all pixels of some tiles are nearer than a chunk.

    A tile has the least inverse depth of its pixels; negative if something was drawn there since.
    """
    height, width = nearness.shape
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            known = tiles[y, x]
            if abs(known) >= most:
                continue
            if known > 0.0:
                return False
            least = np.float32(1e30)
            for row in range(y * TILE, min((y + 1) * TILE, height)):
                for column in range(x * TILE, min((x + 1) * TILE, width)):
                    least = min(least, nearness[row, column])
                if least < most:
                    return False
            tiles[y, x] = least
    return True


@compiled
def draw_triangles(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    corners: Any,
    boxes: Any,
    order: Any,
    nearness: Any,
    seen: Any,
) -> None:
    """Write the inverse depth and the index of the nearest triangle into `nearness` and `seen`, both (H, W).

    They are 0 and -1 before.

    Args:
        eye: (3,) position of the camera.
        axes: (3, 3) rows right, down, forward of the camera in the world.
        focal: focal length, pixels.
        centre_x: centre of the image, pixels.
        centre_y: centre of the image, pixels.
        corners: (T, 3, 3) float32 corners of the triangles; `CHUNK` consecutive ones are a chunk.
        boxes: (C, 2, 3) lowest and highest coordinates of each chunk.
        order: chunks that may be in view, in the order in which they are drawn. One that is behind what is drawn
            already is left out, which changes no pixel.
        nearness: (H, W) float32, written.
        seen: (H, W) int32, written.
    """
    height, width = nearness.shape
    points = np.empty((3, 3))
    clipped = np.empty((4, 3))
    screen = np.empty((4, 2))
    edges = np.empty((4, 4))
    r00, r01, r02 = axes[0, 0], axes[0, 1], axes[0, 2]
    r10, r11, r12 = axes[1, 0], axes[1, 1], axes[1, 2]
    r20, r21, r22 = axes[2, 0], axes[2, 1], axes[2, 2]
    tiles = np.zeros(((height + TILE - 1) // TILE, (width + TILE - 1) // TILE), np.float32)
    bounds = np.empty(5)
    for number in order:
        _bounds(eye, axes, focal, centre_x, centre_y, boxes[number], bounds)
        # Rows and columns of the tiles that the chunk covers.
        y0, y1 = max(int(bounds[2]), 0) // TILE, min(int(bounds[3]), height - 1) // TILE
        x0, x1 = max(int(bounds[0]), 0) // TILE, min(int(bounds[1]), width - 1) // TILE
        if _is_hidden(nearness, tiles, y0, y1, x0, x1, np.float32(bounds[4])):
            continue
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                tiles[y, x] = -abs(tiles[y, x])
        for face in range(number * CHUNK, min((number + 1) * CHUNK, len(corners))):
            behind = 0
            for k in range(3):
                px = np.float64(corners[face, k, 0]) - eye[0]
                py = np.float64(corners[face, k, 1]) - eye[1]
                pz = np.float64(corners[face, k, 2]) - eye[2]
                points[k, 0] = r00 * px + r01 * py + r02 * pz
                points[k, 1] = r10 * px + r11 * py + r12 * pz
                points[k, 2] = r20 * px + r21 * py + r22 * pz
                if points[k, 2] < NEAR_M:
                    behind += 1
            if behind == 3:
                continue
            count = 3
            if behind == 0:
                for k in range(3):
                    inverse = focal / points[k, 2]
                    screen[k, 0] = centre_x + points[k, 0] * inverse
                    screen[k, 1] = centre_y + points[k, 1] * inverse
            else:
                count = 0
                for k in range(3):
                    after = (k + 1) % 3
                    z0, z1 = points[k, 2], points[after, 2]
                    if z0 >= NEAR_M:
                        clipped[count, 0] = points[k, 0]
                        clipped[count, 1] = points[k, 1]
                        clipped[count, 2] = z0
                        count += 1
                    if (z0 >= NEAR_M) != (z1 >= NEAR_M):
                        share = (NEAR_M - z0) / (z1 - z0)
                        clipped[count, 0] = points[k, 0] + share * (points[after, 0] - points[k, 0])
                        clipped[count, 1] = points[k, 1] + share * (points[after, 1] - points[k, 1])
                        clipped[count, 2] = NEAR_M
                        count += 1
                for k in range(count):
                    inverse = focal / clipped[k, 2]
                    screen[k, 0] = centre_x + clipped[k, 0] * inverse
                    screen[k, 1] = centre_y + clipped[k, 1] * inverse
            west, east, north, south = 1e30, -1e30, 1e30, -1e30
            for k in range(count):
                west, east = min(west, screen[k, 0]), max(east, screen[k, 0])
                north, south = min(north, screen[k, 1]), max(south, screen[k, 1])
            top = int(np.ceil(max(north, 0.0)))
            bottom = int(np.ceil(min(south, float(height)))) - 1
            first = int(np.ceil(max(west, 0.0)))
            last = int(np.ceil(min(east, float(width)))) - 1
            if top > bottom or first > last:
                continue
            # Inverse depth is linear on the screen: n . (r_x, r_y, 1) / (n . v) for any corner v.
            ax, ay, az = points[1, 0] - points[0, 0], points[1, 1] - points[0, 1], points[1, 2] - points[0, 2]
            bx, by, bz = points[2, 0] - points[0, 0], points[2, 1] - points[0, 1], points[2, 2] - points[0, 2]
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            away = nx * points[0, 0] + ny * points[0, 1] + nz * points[0, 2]
            size2 = (nx * nx + ny * ny + nz * nz) * (
                points[0, 0] * points[0, 0] + points[0, 1] * points[0, 1] + points[0, 2] * points[0, 2]
            )
            if away * away <= 1e-14 * size2:  # seen from its edge
                continue
            per_x, per_y = nx / (away * focal), ny / (away * focal)
            base = nz / away - per_x * centre_x - per_y * centre_y
            for k in range(count):
                after = k + 1 if k + 1 < count else 0
                # An edge is always traversed from its upper end, so that adjacent triangles leave no gap.
                if screen[k, 1] < screen[after, 1]:
                    upper, lower = k, after
                else:
                    upper, lower = after, k
                edges[k, 0], edges[k, 1], edges[k, 2] = screen[upper, 1], screen[lower, 1], screen[upper, 0]
                rise = screen[lower, 1] - screen[upper, 1]
                edges[k, 3] = (screen[lower, 0] - screen[upper, 0]) / rise if rise > 0.0 else 0.0
            for row in range(top, bottom + 1):
                left, right = 1e30, -1e30
                for k in range(count):
                    if edges[k, 0] <= row < edges[k, 1]:
                        x_at = edges[k, 2] + (row - edges[k, 0]) * edges[k, 3]
                        left, right = min(left, x_at), max(right, x_at)
                low = int(np.ceil(max(left, 0.0)))
                high = int(np.ceil(min(right, float(width)))) - 1
                along = base + per_y * row
                for column in range(low, high + 1):
                    value = np.float32(along + per_x * column)
                    if value > nearness[row, column]:
                        nearness[row, column] = value
                        seen[row, column] = face
