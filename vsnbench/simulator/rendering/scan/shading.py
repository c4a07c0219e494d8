"""Shades the pixels of a scan from the triangles that they show: textures are sampled with integer weights."""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled

LEVELS = 6
"""Number of sizes of a texture, each half of the one before."""
_LOW, _HIGH = np.uint32(0x00FF00FF), np.uint32(0x0000FF00)
_EIGHT, _WHOLE = np.uint32(8), np.uint32(256)


@compiled
def shade_triangles(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    nearness: Any,
    seen: Any,
    corners: Any,
    paint: Any,
    texture: Any,
    density: Any,
    sizes: Any,
    starts: Any,
    texels: Any,
    rgb: Any,
    depth: Any,
) -> int:
    """Write colour and depth of every pixel; depth is NaN where the scan has no surface.

    Args:
        eye: (3,) position of the camera; the next four as in `draw_triangles`.
        axes: (3, 3).
        focal: pixels.
        centre_x: pixels.
        centre_y: pixels.
        nearness: (H, W) float32 from `draw_triangles`.
        seen: (H, W) int32 from `draw_triangles`.
        corners: (T, 3, 3) float32.
        paint: (T, 3, 3) float32 for each corner: u, v, 0 in textures, or a colour from 0 to 255.
        texture: (T,) int32 number of the texture, -1 for colours of corners.
        density: (T,) float32 texels per metre.
        sizes: (N, 2) int64 width and height of each texture, multiples of 32.
        starts: (N, LEVELS) int64 first texel of each size of each texture.
        texels: (M,) uint32 colours 0x00BBGGRR.
        rgb: (H, W, 3) uint8, written; 0 without a surface.
        depth: (H, W) float32, written.

    Returns:
        The number of pixels without a surface.
    """
    height, width = nearness.shape
    points = np.empty((3, 3))
    sums = np.empty((3, 3))
    holes, none = 0, np.int64(0)
    for row in range(height):
        down = (row - centre_y) / focal
        for x in range(width):
            depth[row, x] = np.float32(1.0) / nearness[row, x]
        column = 0
        while column < width:
            face = seen[row, column]
            if face < 0:
                depth[row, column] = np.float32(np.nan)
                rgb[row, column, 0] = rgb[row, column, 1] = rgb[row, column, 2] = 0
                holes += 1
                column += 1
                continue
            end = column + 1
            while end < width and seen[row, end] == face:
                end += 1
            for k in range(3):
                px = np.float64(corners[face, k, 0]) - eye[0]
                py = np.float64(corners[face, k, 1]) - eye[1]
                pz = np.float64(corners[face, k, 2]) - eye[2]
                for axis in range(3):
                    points[k, axis] = axes[axis, 0] * px + axes[axis, 1] * py + axes[axis, 2] * pz
            # A corner's share at a pixel with the ray r is (p_j x p_k) . r, divided by the sum of all three.
            total_x = total_y = total_z = 0.0
            for channel in range(3):
                sums[channel, 0] = sums[channel, 1] = sums[channel, 2] = 0.0
            for k in range(3):
                j, i = (k + 1) % 3, (k + 2) % 3
                cx = points[j, 1] * points[i, 2] - points[j, 2] * points[i, 1]
                cy = points[j, 2] * points[i, 0] - points[j, 0] * points[i, 2]
                cz = points[j, 0] * points[i, 1] - points[j, 1] * points[i, 0]
                total_x, total_y, total_z = total_x + cx, total_y + cy, total_z + cz
                for channel in range(3):
                    value = np.float64(paint[face, k, channel])
                    sums[channel, 0] += value * cx
                    sums[channel, 1] += value * cy
                    sums[channel, 2] += value * cz
            picture = texture[face]
            level = 0
            wide, high, start = np.int64(0), np.int64(0), np.int64(0)
            if picture >= 0:
                middle = (column + end - 1) // 2
                away = 1.0 / nearness[row, middle]
                right = (middle - centre_x) / focal
                # The face's inclination to the ray: |n . r| / (|n| |r|).
                facing = abs(total_x * right + total_y * down + total_z)
                norm = np.sqrt(total_x * total_x + total_y * total_y + total_z * total_z)
                ray = np.sqrt(1.0 + right * right + down * down)
                tilt = max(facing / max(norm * ray, 1e-30), 0.02)
                footprint = np.float64(density[face]) * away / focal / np.sqrt(tilt)
                while footprint > 1.4 and level < LEVELS - 1:
                    footprint *= 0.5
                    level += 1
                wide, high = sizes[picture, 0] >> level, sizes[picture, 1] >> level
                start = starts[picture, level]
            # Each value along the row is (a + b x) / (c + d x).
            d, c = total_x / focal, total_y * down + total_z - total_x * centre_x / focal
            for channel in range(3):
                sums[channel, 1] = sums[channel, 1] * down + sums[channel, 2] - sums[channel, 0] * centre_x / focal
                sums[channel, 0] /= focal
            a0, b0, a1, b1 = sums[0, 1], sums[0, 0], sums[1, 1], sums[1, 0]
            for x in range(column, end):
                scale = 1.0 / (c + d * x)
                first, second = (a0 + b0 * x) * scale, (a1 + b1 * x) * scale
                if picture < 0:
                    third = (sums[2, 1] + sums[2, 0] * x) * scale
                    rgb[row, x, 0] = np.uint8(min(max(first + 0.5, 0.0), 255.0))
                    rgb[row, x, 1] = np.uint8(min(max(second + 0.5, 0.0), 255.0))
                    rgb[row, x, 2] = np.uint8(min(max(third + 0.5, 0.0), 255.0))
                    continue
                u, v = (first - np.floor(first)) * wide - 0.5, (second - np.floor(second)) * high - 0.5
                left, above = np.floor(u), np.floor(v)
                share_u, share_v = np.uint32((u - left) * 256.0), np.uint32((v - above) * 256.0)
                i0, j0 = np.int64(left), np.int64(above)
                i0, j0 = i0 + wide if i0 == -1 else i0, j0 + high if j0 == -1 else j0
                i0, j0 = (
                    i0 if 0 <= i0 < wide else none,
                    j0 if 0 <= j0 < high else none,
                )  # not a number, seen from the edge
                i1, j1 = i0 + 1 if i0 + 1 < wide else 0, j0 + 1 if j0 + 1 < high else 0
                upper = _mixed(texels[start + j0 * wide + i0], texels[start + j0 * wide + i1], share_u)
                lower = _mixed(texels[start + j1 * wide + i0], texels[start + j1 * wide + i1], share_u)
                color = _mixed(upper, lower, share_v)
                rgb[row, x, 0] = np.uint8(color & np.uint32(255))
                rgb[row, x, 1] = np.uint8((color >> _EIGHT) & np.uint32(255))
                rgb[row, x, 2] = np.uint8((color >> np.uint32(16)) & np.uint32(255))
            column = end
    return holes


@compiled
def _mixed(one: Any, other: Any, share: Any) -> Any:
    """Return the colour between two 0x00BBGGRR colours; the share of the other one is from 0 to 256."""
    rest = _WHOLE - share
    outer = np.uint32(np.uint32((one & _LOW) * rest) + np.uint32((other & _LOW) * share)) >> _EIGHT
    inner = np.uint32(np.uint32((one & _HIGH) * rest) + np.uint32((other & _HIGH) * share)) >> _EIGHT
    return np.uint32((outer & _LOW) | (inner & _HIGH))
