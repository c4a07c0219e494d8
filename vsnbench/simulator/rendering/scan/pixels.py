"""Pixels of images of a scan: labels, filled holes, and the part of a texture that triangles show."""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled


@compiled
def label_points(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    depth: Any,
    origin: Any,
    cell: Any,
    first: Any,
    second: Any,
    spans: Any,
    instance: Any,
) -> None:
    """Write the surveyed object of every pixel into `instance` (H, W); 0 for none.

    Args:
        eye: (3,); the next four as in `draw_triangles`.
        axes: (3, 3).
        focal: pixels.
        centre_x: pixels.
        centre_y: pixels.
        depth: (H, W) float32 metres, NaN without a surface.
        origin: (2,) lower left corner of the grids, metres.
        cell: side of a cell, metres.
        first: (rows, columns) int32 number of the highest object over each cell, 0 for none.
        second: (rows, columns) int32 number of the next object over each cell.
        spans: (objects + 1, 2) lowest and highest point of each object, metres.
        instance: (H, W) int32, written.
    """
    height, width = depth.shape
    rows, columns = first.shape
    for row in range(height):
        down = (row - centre_y) / focal
        bx = axes[2, 0] + down * axes[1, 0]
        by = axes[2, 1] + down * axes[1, 1]
        bz = axes[2, 2] + down * axes[1, 2]
        for column in range(width):
            instance[row, column] = 0
            away = np.float64(depth[row, column])
            if not away < 1e6:
                continue
            right = (column - centre_x) / focal
            i = int(np.floor((eye[0] + away * (bx + right * axes[0, 0]) - origin[0]) / cell))
            j = int(np.floor((eye[1] + away * (by + right * axes[0, 1]) - origin[1]) / cell))
            if i < 0 or j < 0 or i >= columns or j >= rows or first[j, i] == 0:
                continue
            z = eye[2] + away * (bz + right * axes[0, 2])
            for number in (first[j, i], second[j, i]):
                if number > 0 and spans[number, 0] <= z <= spans[number, 1]:
                    instance[row, column] = number
                    break


@compiled
def fill_holes(rgb: Any, known: Any) -> None:
    """Fill the pixels of an image (H, W, 3) that are not known with the mean of the known ones around them, in place.

    The mean is over the smallest square of a pyramid of halved images that has a known pixel; between squares it is
    interpolated. Sums are of integers.

    Args:
        rgb: (H, W, 3) uint8.
        known: (H, W) bool.
    """
    height, width = known.shape
    if height < 2 and width < 2:
        return
    rows, columns = (height + 1) // 2, (width + 1) // 2
    small = np.zeros((rows, columns, 3), np.uint8)
    sure = np.zeros((rows, columns), np.bool_)
    missing = False
    for row in range(rows):
        for column in range(columns):
            count = red = green = blue = np.int64(0)
            for y in range(2 * row, min(2 * row + 2, height)):
                for x in range(2 * column, min(2 * column + 2, width)):
                    if known[y, x]:
                        count += 1
                        red += np.int64(rgb[y, x, 0])
                        green += np.int64(rgb[y, x, 1])
                        blue += np.int64(rgb[y, x, 2])
            if count:
                sure[row, column] = True
                small[row, column, 0] = (red + count // 2) // count
                small[row, column, 1] = (green + count // 2) // count
                small[row, column, 2] = (blue + count // 2) // count
            else:
                missing = True
    if missing:
        fill_holes(small, sure)
    for y in range(height):
        for x in range(width):
            if known[y, x]:
                continue
            j, i = y // 2, x // 2
            j1 = min(max(j + (1 if y % 2 else -1), 0), rows - 1)
            i1 = min(max(i + (1 if x % 2 else -1), 0), columns - 1)
            for channel in range(3):
                near = 9 * np.int64(small[j, i, channel]) + 3 * np.int64(small[j1, i, channel])
                far = 3 * np.int64(small[j, i1, channel]) + np.int64(small[j1, i1, channel])
                rgb[y, x, channel] = (near + far + 8) // 16


@compiled
def mark_triangles(corners: Any, shown: Any) -> None:
    """Set the pixels that triangles touch, with one pixel around them.

    Args:
        corners: (T, 3, 2) float32 pixels, x and y.
        shown: (H, W) bool, written.
    """
    height, width = shown.shape
    for face in range(len(corners)):
        x0, y0, x1, y1 = corners[face, 0, 0], corners[face, 0, 1], corners[face, 1, 0], corners[face, 1, 1]
        x2, y2 = corners[face, 2, 0], corners[face, 2, 1]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        sign = 1.0 if area >= 0.0 else -1.0
        reach0 = 1.5 * (abs(x1 - x0) + abs(y1 - y0))
        reach1 = 1.5 * (abs(x2 - x1) + abs(y2 - y1))
        reach2 = 1.5 * (abs(x0 - x2) + abs(y0 - y2))
        for row in range(max(int(min(y0, y1, y2)) - 1, 0), min(int(max(y0, y1, y2)) + 2, height)):
            y = row + 0.5
            for column in range(max(int(min(x0, x1, x2)) - 1, 0), min(int(max(x0, x1, x2)) + 2, width)):
                x = column + 0.5
                if (
                    sign * ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) >= -reach0
                    and sign * ((x2 - x1) * (y - y1) - (x - x1) * (y2 - y1)) >= -reach1
                    and sign * ((x0 - x2) * (y - y2) - (x - x2) * (y0 - y2)) >= -reach2
                ):
                    shown[row, column] = True
