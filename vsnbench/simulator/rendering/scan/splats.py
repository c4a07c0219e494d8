"""Gaussian splats of a scan: drawn from front to back, blended by opacity, with the depth at which half is covered.

Fast maths is off, one thread draws, and exponentials come from a table, so that the same splats give the same pixels on
every machine.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.runtime.numba_cache import compiled

MOST_SPLATS: Final = 2_000_000
_NEAREST_M: Final = 0.1
"""Minimum depth of a drawn splat's centre."""
_SOFT_PX2: Final = 0.3
"""Variance that the pixel's own size adds on the screen, as in the training of 3D Gaussian splatting."""
_WIDEST_PX: Final = 1e5
_TILE: Final = 16
_STEPS: Final = 256
"""Entries of the table of exponentials for each unit."""
_LAST: Final = 6
"""Exponent at which the table ends; a splat of opacity 255 ends before."""

Floats = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]

_LOGARITHMS: Final = np.array([0.0, *(math.log(opacity) for opacity in range(1, 256))], np.float32)
"""Exponent at which a splat of each opacity, 0 to 255, covers one part in 255."""
_EXPONENTIALS: Final = np.array([math.exp(-(k + 0.5) / _STEPS) for k in range(_LAST * _STEPS)], np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Splats:
    """N Gaussian splats in the frame of the scan's triangles."""

    centres: Floats
    """(N, 3)."""
    spreads: Floats
    """(N, 6) covariance: xx, xy, xz, yy, yz, zz."""
    paint: Bytes
    """(N, 4) sRGB and opacity."""

    def problem(self, farthest: float) -> str:
        """Return what is wrong with the values; empty if nothing is."""
        count = len(self.centres)
        if not 0 < count <= MOST_SPLATS:
            return f"it has {count:,} splats; the limit is {MOST_SPLATS:,}"
        if len(self.spreads) != count or len(self.paint) != count:
            return "its arrays of splats have different lengths"
        if not np.abs(self.centres).max() <= farthest or not np.abs(self.spreads).max() <= farthest:  # NaN as well
            return f"splats are not within {farthest:g} m"
        return ""

    def chosen(self, which: npt.NDArray[Any]) -> "Splats":
        """Return the splats of an index or a mask."""
        return Splats(*(np.ascontiguousarray(values[which]) for values in (self.centres, self.spreads, self.paint)))

    def moved(self, matrix: npt.NDArray[np.float64], shift: npt.NDArray[np.float64]) -> "Splats":
        """Return the splats under an affine transformation: `matrix` (3, 3), then `shift` (3,)."""
        xx, xy, xz, yy, yz, zz = self.spreads.astype(np.float64).T
        whole = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
        turned = (matrix @ whole @ matrix.T).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
        centres = np.round(self.centres @ matrix.T + shift, 5)
        return Splats(centres.astype(np.float32), turned.astype(np.float32), self.paint)

    def draw(
        self,
        view: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float, float, float],
        chunks: tuple[npt.NDArray[np.intp], int],
        depth_m: Floats,
    ) -> Floats:
        """Draw a view of splats whose neighbours in the arrays are near each other.

        Args:
            view: position, axes, focal length and centre of the camera, as in `draw_triangles`.
            chunks: the chunks that may be in view, and the number of consecutive splats of a chunk.
            depth_m: (H, W), written: where half of the light is covered; NaN where less is.

        Returns:
            (H, W, 4) the light of red, green and blue, 0 to 255, and the share that is not covered.
        """
        screen = np.empty((len(self.centres), 10), np.float32)
        index = np.empty(len(self.centres), np.int32)
        arrays = (self.centres, self.spreads, self.paint, *chunks, _LOGARITHMS)
        count = project_splats(*view, *arrays, depth_m.shape[1], depth_m.shape[0], screen, index)
        order = np.argsort(screen[:count, 5], kind="stable")
        light = np.zeros((*depth_m.shape, 4), np.float32)
        light[..., 3] = 1.0
        depth_m.fill(np.nan)
        blend_splats(order, screen, index, self.paint, _EXPONENTIALS, light, depth_m)
        return light


@compiled
def project_splats(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    centres: Any,
    spreads: Any,
    paint: Any,
    chunks: Any,
    chunk: Any,
    logarithms: Any,
    width: Any,
    height: Any,
    screen: Any,
    index: Any,
) -> int:
    """Write what is needed to blend the splats in view.

    Args:
        eye: (3,); the next four as in `draw_triangles`.
        axes: (3, 3).
        focal: pixels.
        centre_x: pixels.
        centre_y: pixels.
        centres: (N, 3) float32.
        spreads: (N, 6) float32.
        paint: (N, 4) uint8.
        chunks: chunks that may be in view.
        chunk: number of consecutive splats of a chunk.
        logarithms: (256,) float32 largest exponent of each opacity.
        width: pixels.
        height: pixels.
        screen: (N, 10) float32, written: x, y, the inverse covariance xx, xy, yy (1/px²), depth, its slope along x
            and y (m/px), the largest exponent, and how far the depth may be from that of the centre.
        index: (N,) int32 number of the splat, written.

    Returns:
        The number of splats in view.
    """
    slope_x = max(centre_x + 0.5, width - centre_x) / focal
    slope_y = max(centre_y + 0.5, height - centre_y) / focal
    r00, r01, r02 = axes[0, 0], axes[0, 1], axes[0, 2]
    r10, r11, r12 = axes[1, 0], axes[1, 1], axes[1, 2]
    r20, r21, r22 = axes[2, 0], axes[2, 1], axes[2, 2]
    count = 0
    for number in chunks:
        for splat in range(number * chunk, min((number + 1) * chunk, len(centres))):
            opacity = paint[splat, 3]
            if opacity < 2:
                continue
            dx = np.float64(centres[splat, 0]) - eye[0]
            dy = np.float64(centres[splat, 1]) - eye[1]
            dz = np.float64(centres[splat, 2]) - eye[2]
            z = r20 * dx + r21 * dy + r22 * dz
            if z < _NEAREST_M:
                continue
            x = (r00 * dx + r01 * dy + r02 * dz) / z
            y = (r10 * dx + r11 * dy + r12 * dz) / z
            # The screen is taken as flat around the splat; far outside of it that would be wrong without a limit.
            near_x = min(max(x, -1.3 * slope_x), 1.3 * slope_x)
            near_y = min(max(y, -1.3 * slope_y), 1.3 * slope_y)
            per = focal / z
            ux, uy, uz = per * (r00 - near_x * r20), per * (r01 - near_x * r21), per * (r02 - near_x * r22)
            vx, vy, vz = per * (r10 - near_y * r20), per * (r11 - near_y * r21), per * (r12 - near_y * r22)
            xx, xy, xz = np.float64(spreads[splat, 0]), np.float64(spreads[splat, 1]), np.float64(spreads[splat, 2])
            yy, yz, zz = np.float64(spreads[splat, 3]), np.float64(spreads[splat, 4]), np.float64(spreads[splat, 5])
            ax, ay, az = xx * ux + xy * uy + xz * uz, xy * ux + yy * uy + yz * uz, xz * ux + yz * uy + zz * uz
            bx, by, bz = xx * vx + xy * vy + xz * vz, xy * vx + yy * vy + yz * vz, xz * vx + yz * vy + zz * vz
            uu = ux * ax + uy * ay + uz * az + _SOFT_PX2
            uv = ux * bx + uy * by + uz * bz
            vv = vx * bx + vy * by + vz * bz + _SOFT_PX2
            determinant = uu * vv - uv * uv
            if not uu > 0.0 or not vv > 0.0:
                continue
            most = np.float64(logarithms[opacity])
            at_x, at_y = centre_x + focal * x, centre_y + focal * y
            reach_x, reach_y = np.sqrt(2.0 * most * uu), np.sqrt(2.0 * most * vv)
            if not max(reach_x, reach_y) < _WIDEST_PX or not determinant > 1e-6 * uu * vv:
                continue
            if not (-reach_x < at_x < width - 1 + reach_x and -reach_y < at_y < height - 1 + reach_y):
                continue
            zu, zv = r20 * ax + r21 * ay + r22 * az, r20 * bx + r21 * by + r22 * bz
            cx, cy, cz = xx * r20 + xy * r21 + xz * r22, xy * r20 + yy * r21 + yz * r22, xz * r20 + yz * r21 + zz * r22
            a, b, c = vv / determinant, -uv / determinant, uu / determinant
            screen[count, 0], screen[count, 1] = at_x, at_y
            screen[count, 2], screen[count, 3], screen[count, 4] = a, b, c
            screen[count, 5] = z
            screen[count, 6], screen[count, 7] = zu * a + zv * b, zu * b + zv * c
            screen[count, 8] = most
            screen[count, 9] = min(3.0 * np.sqrt(max(r20 * cx + r21 * cy + r22 * cz, 0.0)), z - _NEAREST_M / 2)
            index[count] = splat
            count += 1
    return count


@compiled
def blend_splats(order: Any, screen: Any, index: Any, paint: Any, exponentials: Any, light: Any, depth: Any) -> None:
    """Blend splats from front to back.

    Args:
        order: (K,) rows of `screen`, nearest first.
        screen: (N, 10) float32 from `project_splats`.
        index: (N,) int32 from `project_splats`.
        paint: (N, 4) uint8.
        exponentials: (n,) float32 exp(-k / _STEPS).
        light: (H, W, 4) float32: 0, 0, 0, 1 before; light of the colours, and the share that is not covered.
        depth: (H, W) float32, written where the share falls below a half.
    """
    height, width = depth.shape
    rows, columns = (height + _TILE - 1) // _TILE, (width + _TILE - 1) // _TILE
    # Number of pixels of each tile that are not covered yet.
    left = np.empty((rows, columns), np.int64)
    for j in range(rows):
        for i in range(columns):
            left[j, i] = min(_TILE, height - j * _TILE) * min(_TILE, width - i * _TILE)
    half, covered = np.float32(0.5), np.float32(1 / 256)
    one, most_opaque = np.float32(1.0), np.float32(0.99)
    for k in order:
        x0, y0, a, b, c = screen[k, 0], screen[k, 1], screen[k, 2], screen[k, 3], screen[k, 4]
        z, along_x, along_y, most, reach = screen[k, 5], screen[k, 6], screen[k, 7], screen[k, 8], screen[k, 9]
        determinant = a * c - b * b
        reach_x, reach_y = np.sqrt(2 * most * c / determinant), np.sqrt(2 * most * a / determinant)
        if not max(reach_x, reach_y) < 2 * _WIDEST_PX:
            continue
        top, bottom = int(np.ceil(max(y0 - reach_y, 0.0))), int(np.floor(min(y0 + reach_y, height - 1.0)))
        first, last = int(np.ceil(max(x0 - reach_x, 0.0))), int(np.floor(min(x0 + reach_x, width - 1.0)))
        if top > bottom or first > last:
            continue
        is_open = False
        for j in range(top // _TILE, bottom // _TILE + 1):
            for i in range(first // _TILE, last // _TILE + 1):
                is_open = is_open or left[j, i] > 0
        if not is_open:
            continue
        splat = index[k]
        red, green, blue = np.float32(paint[splat, 0]), np.float32(paint[splat, 1]), np.float32(paint[splat, 2])
        opacity = np.float32(paint[splat, 3]) / np.float32(255.0)
        for row in range(top, bottom + 1):
            dy = np.float32(row) - y0
            inside = b * dy * (b * dy) - a * (c * dy * dy - 2 * most)
            if not inside >= 0.0:
                continue
            middle, half_width = x0 - b * dy / a, np.sqrt(inside) / a
            if not abs(middle) + half_width < 4 * _WIDEST_PX:
                continue
            low = max(int(np.ceil(middle - half_width)), 0)
            high = min(int(np.floor(middle + half_width)), width - 1)
            fixed, slope = half * c * dy * dy, b * dy
            for column in range(low, high + 1):
                share = light[row, column, 3]
                if share < covered:
                    continue
                dx = np.float32(column) - x0
                exponent = half * a * dx * dx + slope * dx + fixed
                if not exponent < _LAST:
                    continue
                entry = int(max(exponent, np.float32(0.0)) * np.float32(_STEPS))
                alpha = min(opacity * exponentials[entry], most_opaque)
                weight = alpha * share
                light[row, column, 0] += weight * red
                light[row, column, 1] += weight * green
                light[row, column, 2] += weight * blue
                rest = share * (one - alpha)
                light[row, column, 3] = rest
                if rest < half <= share:
                    off = along_x * dx + along_y * dy
                    depth[row, column] = z + min(max(off, -reach), reach)
                if rest < covered:
                    left[row // _TILE, column // _TILE] -= 1
