"""Rasterizer: draws convex faces front to back into a buffer of inverse depths.

Fast maths is off and it uses one thread, so that the same scene gives the same pixels in every run on every machine.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.runtime.numba_cache import compiled

NEAR_M = 0.02
"""Minimum depth of drawn surfaces, metres along the optical axis."""


@compiled
def draw_faces(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    corners: Any,
    normals: Any,
    centres: Any,
    radii: Any,
    faces: Any,
    order: Any,
    nearness: Any,
    seen: Any,
) -> None:
    """Write the inverse depth and the index of the nearest face into `nearness` and `seen`, both (H, W).

    They are 0 and -1 before. Rows of `axes` are the camera's right, down and forward axes in the world; `order` is from
    `nearest_first`; for the other arrays see `Mesh`. Items are assigned one by one: an assignment of slices, and
    functions of numpy, would take seconds to compile.
    """
    height, width = nearness.shape
    left = np.empty(height, np.float64)
    right = np.empty(height, np.float64)
    points = np.empty((4, 3))
    clipped = np.empty((8, 3))
    screen = np.empty((8, 2))
    counted = np.empty(width, np.float32)
    for k in range(width):
        counted[k] = k
    # Half angles of the view, including half a pixel.
    slope_x = max(centre_x, width - centre_x) / focal
    slope_y = max(centre_y, height - centre_y) / focal
    norm_x = np.sqrt(1.0 + slope_x * slope_x)
    norm_y = np.sqrt(1.0 + slope_y * slope_y)
    for primitive in order:
        dx = centres[primitive, 0] - eye[0]
        dy = centres[primitive, 1] - eye[1]
        dz = centres[primitive, 2] - eye[2]
        x = axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz
        y = axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz
        z = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
        radius = radii[primitive]
        if z + radius < NEAR_M:
            continue
        if abs(x) - slope_x * z > radius * norm_x or abs(y) - slope_y * z > radius * norm_y:
            continue
        for face in range(faces[primitive, 0], faces[primitive, 1]):
            ex = eye[0] - corners[face, 0, 0]
            ey = eye[1] - corners[face, 0, 1]
            ez = eye[2] - corners[face, 0, 2]
            distance = normals[face, 0] * ex + normals[face, 1] * ey + normals[face, 2] * ez
            if distance <= 1e-6:
                continue
            behind = 0
            for k in range(4):
                px = corners[face, k, 0] - eye[0]
                py = corners[face, k, 1] - eye[1]
                pz = corners[face, k, 2] - eye[2]
                points[k, 0] = axes[0, 0] * px + axes[0, 1] * py + axes[0, 2] * pz
                points[k, 1] = axes[1, 0] * px + axes[1, 1] * py + axes[1, 2] * pz
                points[k, 2] = axes[2, 0] * px + axes[2, 1] * py + axes[2, 2] * pz
                if points[k, 2] < NEAR_M:
                    behind += 1
            if behind == 4:
                continue
            count = 0
            for k in range(4):
                after = (k + 1) % 4
                z0, z1 = points[k, 2], points[after, 2]
                if z0 >= NEAR_M:
                    clipped[count, 0] = points[k, 0]
                    clipped[count, 1] = points[k, 1]
                    clipped[count, 2] = points[k, 2]
                    count += 1
                if (z0 >= NEAR_M) != (z1 >= NEAR_M):
                    share = (NEAR_M - z0) / (z1 - z0)
                    clipped[count, 0] = points[k, 0] + share * (points[after, 0] - points[k, 0])
                    clipped[count, 1] = points[k, 1] + share * (points[after, 1] - points[k, 1])
                    clipped[count, 2] = NEAR_M
                    count += 1
            lowest, highest = 1e30, -1e30
            for k in range(count):
                inverse = focal / clipped[k, 2]
                screen[k, 0] = centre_x + clipped[k, 0] * inverse
                screen[k, 1] = centre_y + clipped[k, 1] * inverse
                lowest = min(lowest, screen[k, 1])
                highest = max(highest, screen[k, 1])
            top = max(0, int(np.ceil(max(lowest, -1.0))))
            bottom = min(height - 1, int(np.ceil(min(highest, height + 1.0))) - 1)
            if top > bottom:
                continue
            for row in range(top, bottom + 1):
                left[row] = 1e30
                right[row] = -1e30
            for k in range(count):
                after = k + 1 if k + 1 < count else 0
                # An edge is always traversed from its upper end, so that adjacent faces leave no gap.
                if screen[k, 1] < screen[after, 1] or (
                    screen[k, 1] == screen[after, 1] and screen[k, 0] <= screen[after, 0]
                ):
                    upper, lower = k, after
                else:
                    upper, lower = after, k
                x0, y0 = screen[upper, 0], screen[upper, 1]
                x1, y1 = screen[lower, 0], screen[lower, 1]
                if y0 == y1:
                    continue
                start = max(top, int(np.ceil(max(y0, -1.0))))
                stop = min(bottom, int(np.ceil(min(y1, height + 1.0))) - 1)
                slope = (x1 - x0) / (y1 - y0)
                for row in range(start, stop + 1):
                    x_at = x0 + (row - y0) * slope
                    if x_at < left[row]:
                        left[row] = x_at
                    if x_at > right[row]:
                        right[row] = x_at
            # Inverse depth is linear on the screen: n . (r_x, r_y, 1) / (n . v) for any corner v of the face.
            nx = axes[0, 0] * normals[face, 0] + axes[0, 1] * normals[face, 1] + axes[0, 2] * normals[face, 2]
            ny = axes[1, 0] * normals[face, 0] + axes[1, 1] * normals[face, 1] + axes[1, 2] * normals[face, 2]
            nz = axes[2, 0] * normals[face, 0] + axes[2, 1] * normals[face, 1] + axes[2, 2] * normals[face, 2]
            scale = -1.0 / distance
            per_x = np.float32(nx * scale / focal)
            for row in range(top, bottom + 1):
                low = max(0, int(np.ceil(max(left[row], -1.0))))
                high = min(width - 1, int(np.ceil(min(right[row], width + 1.0))) - 1)
                if low > high:
                    continue
                base = np.float32(scale * (nz + ny * (row - centre_y) / focal + nx * (low - centre_x) / focal))
                # With indices relative to the first pixel of the span, the compiler vectorizes this comparison.
                depths, ids = nearness[row, low : high + 1], seen[row, low : high + 1]
                for k in range(len(depths)):
                    value = base + per_x * counted[k]
                    if value > depths[k]:
                        depths[k] = value
                        ids[k] = face


def nearest_first(eye: Any, centres: Any, radii: Any) -> npt.NDArray[np.intp]:
    """Return the indices of the primitives ordered by the distance of their bounding spheres from the eye; stable."""
    dx, dy, dz = centres[:, 0] - eye[0], centres[:, 1] - eye[1], centres[:, 2] - eye[2]
    return np.argsort(np.sqrt(dx * dx + dy * dy + dz * dz) - radii, kind="stable")
