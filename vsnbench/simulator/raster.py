"""The rasteriser's two kernels: which face a pixel sees, and what colour it has there.

The first draws convex faces front to back into a buffer of inverse depths; the second colours every pixel once.
No fast maths and one thread: the same scene gives the same pixels on every run and every machine.
"""

from typing import Any

import numpy as np

from vsnbench.compilation import compiled
from vsnbench.simulator.textures import FULL, LEVELS, SIZE

NEAR_M = 0.02
"""Nothing nearer than this to the eye is drawn, metres along the optical axis."""
_SEGMENT = 16
"""Pixels of a row that share a texture size."""
_TEXTURE_PIXELS = (4 * SIZE * SIZE - 1) // 3
TONES = 4096
"""Steps of the table from light to sRGB; it ends at twice the light of white."""


@compiled
def draw_faces(
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

    `axes` are the rows right, down, forward of the camera in the world; `order` lists primitives, nearest first.
    """
    height, width = nearness.shape
    nearness[:] = 0.0
    seen[:] = -1
    left = np.empty(height, np.float64)
    right = np.empty(height, np.float64)
    points = np.empty((4, 3))
    clipped = np.empty((8, 3))
    screen = np.empty((8, 2))
    # Half angles of the view, with the pixels' own half width.
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
                    clipped[count] = points[k]
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
                # An edge is walked from its upper end, whichever face it is drawn for: neighbours leave no crack.
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
            # Inverse depth is linear on the screen: n . (r_x, r_y, 1) / (n . v), whatever the face's corners.
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
                depths = nearness[row]
                ids = seen[row]
                for column in range(low, high + 1):
                    value = base + per_x * np.float32(column - low)
                    if value > depths[column]:
                        depths[column] = value
                        ids[column] = face


@compiled
def shade_pixels(
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    nearness: Any,
    seen: Any,
    normals: Any,
    axis_s: Any,
    axis_t: Any,
    texture: Any,
    texture_map: Any,
    owner: Any,
    colors: Any,
    glow: Any,
    categories: Any,
    instances: Any,
    light_start: Any,
    light_size: Any,
    light_map: Any,
    light: Any,
    atlas: Any,
    level_start: Any,
    sky: Any,
    tones: Any,
    rgb: Any,
    depth: Any,
    category: Any,
    instance: Any,
) -> None:
    """Colour every pixel that `draw_faces` has found; also writes depth (inf for nothing) and both ids."""
    height, width = nearness.shape
    one = np.float32(1.0)
    per_light = np.float32(TONES / 2.0)
    for row in range(height):
        down = (row - centre_y) / focal
        bx = axes[2, 0] + down * axes[1, 0]
        by = axes[2, 1] + down * axes[1, 1]
        bz = axes[2, 2] + down * axes[1, 2]
        column = 0
        while column < width:
            face = seen[row, column]
            end = column + 1
            while end < width and seen[row, end] == face:
                end += 1
            if face < 0:
                for x in range(column, end):
                    rgb[row, x, 0] = 0
                    rgb[row, x, 1] = 0
                    rgb[row, x, 2] = 0
                    depth[row, x] = np.inf
                    category[row, x] = 0
                    instance[row, x] = 0
                column = end
                continue
            thing = owner[face]
            kind = categories[thing]
            number = instances[thing]
            for x in range(column, end):
                depth[row, x] = one / nearness[row, x]
                category[row, x] = kind
                instance[row, x] = number
            picture = texture[face]
            if picture == sky:
                for x in range(column, end):
                    right = (x - centre_x) / focal
                    dx = bx + right * axes[0, 0]
                    dy = by + right * axes[0, 1]
                    dz = bz + right * axes[0, 2]
                    # The quarter turn as a share of the diamond |x| + |y| = 1: no trigonometry.
                    around = dy / (abs(dx) + abs(dy) + 1e-9)
                    if dx < 0.0:
                        around = 2.0 - around
                    elevation = dz / np.sqrt(dx * dx + dy * dy + dz * dz)
                    u = np.float32((around * 0.25 + 0.25) * SIZE)
                    v = np.float32((elevation * 0.5 + 0.5) * SIZE)
                    i, j = int(np.floor(u)), int(np.floor(v))
                    fu, fv = u - np.float32(i), v - np.float32(j)
                    j1 = min(j + 1, SIZE - 1)
                    at = np.int64(picture) * _TEXTURE_PIXELS
                    p00 = at + (j & (SIZE - 1)) * SIZE + (i & (SIZE - 1))
                    p01 = at + (j & (SIZE - 1)) * SIZE + ((i + 1) & (SIZE - 1))
                    p10 = at + j1 * SIZE + (i & (SIZE - 1))
                    p11 = at + j1 * SIZE + ((i + 1) & (SIZE - 1))
                    for channel in range(3):
                        low = atlas[p00, channel] * (one - fu) + atlas[p01, channel] * fu
                        high = atlas[p10, channel] * (one - fu) + atlas[p11, channel] * fu
                        value = (low * (one - fv) + high * fv) / np.float32(FULL)
                        rgb[row, x, channel] = tones[min(int(value * per_light), TONES - 1)]
                column = end
                continue
            # s = a + z * (b + c * column), and the same for t.
            s_a = axis_s[face, 0] * eye[0] + axis_s[face, 1] * eye[1] + axis_s[face, 2] * eye[2]
            t_a = axis_t[face, 0] * eye[0] + axis_t[face, 1] * eye[1] + axis_t[face, 2] * eye[2]
            s_b = axis_s[face, 0] * bx + axis_s[face, 1] * by + axis_s[face, 2] * bz
            t_b = axis_t[face, 0] * bx + axis_t[face, 1] * by + axis_t[face, 2] * bz
            s_c = (axis_s[face, 0] * axes[0, 0] + axis_s[face, 1] * axes[0, 1] + axis_s[face, 2] * axes[0, 2]) / focal
            t_c = (axis_t[face, 0] * axes[0, 0] + axis_t[face, 1] * axes[0, 1] + axis_t[face, 2] * axes[0, 2]) / focal
            n_b = normals[face, 0] * bx + normals[face, 1] * by + normals[face, 2] * bz
            n_c = (
                normals[face, 0] * axes[0, 0] + normals[face, 1] * axes[0, 1] + normals[face, 2] * axes[0, 2]
            ) / focal
            red, green, blue = (
                np.float32(colors[thing, 0]),
                np.float32(colors[thing, 1]),
                np.float32(colors[thing, 2]),
            )
            own = np.float32(glow[thing])
            map_s, off_s = texture_map[face, 0], texture_map[face, 1]
            map_t, off_t = texture_map[face, 2], texture_map[face, 3]
            l_s, lo_s, l_t, lo_t = light_map[face, 0], light_map[face, 1], light_map[face, 2], light_map[face, 3]
            light_at = light_start[face]
            cells_s, cells_t = light_size[face, 0], light_size[face, 1]
            top_s, top_t = cells_s - 1.0, cells_t - 1.0
            first = column
            while first < end:
                last = min(end, first + _SEGMENT)
                level = 0
                level_at = np.int64(0)
                size = SIZE
                if picture != 0:
                    middle = (first + last) * 0.5 - centre_x
                    far = depth[row, (first + last) // 2] if (first + last) // 2 < end else depth[row, first]
                    tilt = max(abs(n_b + n_c * middle), 0.02)
                    footprint = far / focal / np.sqrt(tilt) * np.sqrt(map_s * map_t) * SIZE
                    while footprint > 1.4 and level < LEVELS - 1:
                        footprint *= 0.5
                        level += 1
                    size = SIZE >> level
                    level_at = np.int64(picture) * _TEXTURE_PIXELS + level_start[level]
                mask = size - 1
                for x in range(first, last):
                    z = np.float64(depth[row, x])
                    offset = x - centre_x
                    s = s_a + z * (s_b + s_c * offset)
                    t = t_a + z * (t_b + t_c * offset)
                    ls = min(max(s * l_s + lo_s, 0.0), top_s)
                    lt = min(max(t * l_t + lo_t, 0.0), top_t)
                    i, j = int(ls), int(lt)
                    i = min(i, cells_s - 2)
                    j = min(j, cells_t - 2)
                    fs, ft = np.float32(ls - i), np.float32(lt - j)
                    w11 = fs * ft
                    w10 = ft - w11
                    w01 = fs - w11
                    w00 = one - fs - w10
                    p = light_at + j * cells_s + i
                    q = p + cells_s
                    lr = light[p, 0] * w00 + light[p + 1, 0] * w01 + light[q, 0] * w10 + light[q + 1, 0] * w11
                    lg = light[p, 1] * w00 + light[p + 1, 1] * w01 + light[q, 1] * w10 + light[q + 1, 1] * w11
                    lb = light[p, 2] * w00 + light[p + 1, 2] * w01 + light[q, 2] * w10 + light[q + 1, 2] * w11
                    lr = (lr + own) * red
                    lg = (lg + own) * green
                    lb = (lb + own) * blue
                    if picture != 0:
                        u = (s * map_s + off_s) * size - 0.5
                        v = (t * map_t + off_t) * size - 0.5
                        iu, iv = int(np.floor(u)), int(np.floor(v))
                        fu, fv = np.float32(u - iu), np.float32(v - iv)
                        w11 = fu * fv
                        w10 = fv - w11
                        w01 = fu - w11
                        w00 = one - fu - w10
                        row0 = level_at + (iv & mask) * size
                        row1 = level_at + ((iv + 1) & mask) * size
                        c0, c1 = iu & mask, (iu + 1) & mask
                        p00, p01, p10, p11 = row0 + c0, row0 + c1, row1 + c0, row1 + c1
                        inverse = np.float32(1.0 / FULL)
                        lr *= inverse * (
                            atlas[p00, 0] * w00 + atlas[p01, 0] * w01 + atlas[p10, 0] * w10 + atlas[p11, 0] * w11
                        )
                        lg *= inverse * (
                            atlas[p00, 1] * w00 + atlas[p01, 1] * w01 + atlas[p10, 1] * w10 + atlas[p11, 1] * w11
                        )
                        lb *= inverse * (
                            atlas[p00, 2] * w00 + atlas[p01, 2] * w01 + atlas[p10, 2] * w10 + atlas[p11, 2] * w11
                        )
                    rgb[row, x, 0] = tones[min(int(lr * per_light), TONES - 1)]
                    rgb[row, x, 1] = tones[min(int(lg * per_light), TONES - 1)]
                    rgb[row, x, 2] = tones[min(int(lb * per_light), TONES - 1)]
                first = last
            column = end
