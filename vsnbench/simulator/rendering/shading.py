"""Shading: computes the colour of each pixel once its face is known.

A surface is shaded in segments of a row: first the texture and light coordinates of many pixels at a time, then the
colours, four channels at a time. Pixels are assigned one by one, because an assignment of slices takes seconds to
compile. Fast maths is off and it uses one thread, so that the same scene gives the same pixels in every run on every
machine.
"""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled
from vsnbench.simulator.rendering.simd import first_three_steps, four_at
from vsnbench.simulator.rendering.textures import FULL, LEVELS, SIZE

STRETCH = 16
"""Number of pixels of a row that are shaded together, with one texture size."""
TONES = 4096
"""Steps of the table from light to sRGB, which ends at twice the light of white."""
GRAIN = 2048
"""Number of pixels after which the sensor's noise repeats along a row; a power of two."""
VIGNETTE = 0.22
"""Share of the light that is missing in the corners of an image."""
OUTDOORS = 1.7
"""Brightness of the outdoors at the exposure of a room."""
_TEXTURE_PIXELS = (4 * SIZE * SIZE - 1) // 3
_BITS = LEVELS - 1
_ONE = np.float32(1.0)
_PER_LIGHT = np.float32(TONES / 2.0)
_PER_STORED = np.float32(1.0 / FULL)


@compiled
def shade_pixels(  # noqa: PLR0913 - compiled functions take arrays, not objects
    eye: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    centre_y: Any,
    nearness: Any,
    seen: Any,
    surface: Any,
    light: Any,
    atlas: Any,
    level_start: Any,
    sky: Any,
    tones: Any,
    grain: Any,
    seed: Any,
    rgb: Any,
    depth: Any,
) -> None:
    """Write colour and depth of every pixel; depth is infinite without a surface.

    Args:
        eye: (3,) position of the camera.
        axes: (3, 3) rows right, down, forward of the camera in the world.
        focal: focal length, pixels.
        centre_x: centre of the image, pixels.
        centre_y: centre of the image, pixels.
        nearness: (H, W) float32 from `draw_faces`.
        seen: (H, W) int32 from `draw_faces`.
        surface: arrays of faces and objects, see `Renderer`.
        light: (N, 4) float32 cells of all light maps.
        atlas: (M, 4) uint8 pixels of all textures.
        level_start: (LEVELS,) start of each size of a texture.
        sky: index of the texture of the outdoors.
        tones: (TONES,) uint8 sRGB by light.
        grain: (GRAIN + STRETCH, 4) float32 factors of the sensor's noise; the last rows repeat the first.
        seed: which part of `grain` an image uses.
        rgb: (H, W, 3) uint8, written.
        depth: (H, W) float32, written.
    """
    normals, axis_s, axis_t, texture, texture_map, owner, tints, glow, light_start, light_size, light_map = surface
    height, width = nearness.shape
    places = np.empty((5, STRETCH), np.int32)
    shares = np.empty((8, STRETCH), np.float32)
    fall_off = -VIGNETTE / (centre_x * centre_x + centre_y * centre_y + 1.0)
    for row in range(height):
        for x in range(width):
            depth[row, x] = _ONE / nearness[row, x]
        down = (row - centre_y) / focal
        bx = axes[2, 0] + down * axes[1, 0]
        by = axes[2, 1] + down * axes[1, 1]
        bz = axes[2, 2] + down * axes[1, 2]
        noise_at = grain_start(seed, row)
        edge = 1.0 + fall_off * (row - centre_y) * (row - centre_y)
        column = np.int64(0)  # with a literal 0, `_shade_sky` would be compiled twice
        while column < width:
            face = seen[row, column]
            end = column + _run_length(seen[row, column:width])
            if face < 0:
                for x in range(column, end):
                    rgb[row, x, 0] = rgb[row, x, 1] = rgb[row, x, 2] = 0
                column = end
                continue
            picture = texture[face]
            if picture == sky:
                _shade_sky(
                    row, column, end, bx, by, bz, axes, focal, centre_x, picture, atlas, tones, edge, fall_off, rgb
                )
                column = end
                continue
            thing = owner[face]
            tint = four_at(tints, thing)
            own = glow[thing]
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
            map_s, off_s = texture_map[face, 0], texture_map[face, 1]
            map_t, off_t = texture_map[face, 2], texture_map[face, 3]
            l_s, lo_s, l_t, lo_t = light_map[face, 0], light_map[face, 1], light_map[face, 2], light_map[face, 3]
            light_at, cells_s = np.float64(light_start[face]), np.intp(light_size[face, 0])
            wide = np.float64(cells_s)
            top_s, top_t = wide - 1.0, light_size[face, 1] - 1.0
            last_s, last_t = top_s - 1.0, top_t - 1.0
            first = column
            while first < end:
                last = min(end, first + STRETCH)
                level = 0
                level_at = np.int64(0)
                bits = _BITS
                middle = (first + last) * 0.5 - centre_x
                # The fall-off of the lens is the same for one stretch: it is smaller than the noise.
                steps = tint * np.float32((edge + fall_off * middle * middle) * (TONES / 2.0))
                if picture != 0:
                    far = depth[row, (first + last) // 2] if (first + last) // 2 < end else depth[row, first]
                    tilt = max(abs(n_b + n_c * middle), 0.02)
                    footprint = far / focal / np.sqrt(tilt) * np.sqrt(map_s * map_t) * SIZE
                    while footprint > 1.4 and level < LEVELS - 1:
                        footprint *= 0.5
                        level += 1
                    bits = _BITS - level
                    level_at = np.int64(picture) * _TEXTURE_PIXELS + level_start[level]
                mask = (1 << bits) - 1
                size = np.float64(1 << bits)
                ahead, colors = depth[row, first:last], rgb[row, first:last]
                for k in range(last - first):
                    z = np.float64(ahead[k])
                    offset = (first + k) - centre_x
                    s = s_a + z * (s_b + s_c * offset)
                    t = t_a + z * (t_b + t_c * offset)
                    ls, lt = s * l_s + lo_s, t * l_t + lo_t
                    ls = 0.0 if ls < 0.0 else ls
                    lt = 0.0 if lt < 0.0 else lt
                    ls = top_s if ls > top_s else ls
                    lt = top_t if lt > top_t else lt
                    i, j = np.floor(ls), np.floor(lt)
                    i = last_s if i > last_s else i
                    j = last_t if j > last_t else j
                    fs, ft = np.float32(ls - i), np.float32(lt - j)
                    w11 = fs * ft
                    shares[3, k] = w11
                    w10 = ft - w11
                    shares[2, k] = w10
                    shares[1, k] = fs - w11
                    shares[0, k] = _ONE - fs - w10
                    places[0, k] = np.int32(light_at + j * wide + i)
                    u = np.floor((s * map_s + off_s) * size - 0.5)
                    v = np.floor((t * map_t + off_t) * size - 0.5)
                    fu = np.float32(((s * map_s + off_s) * size - 0.5) - u)
                    fv = np.float32(((t * map_t + off_t) * size - 0.5) - v)
                    w11 = fu * fv
                    shares[7, k] = w11
                    w10 = fv - w11
                    shares[6, k] = w10
                    shares[5, k] = fu - w11
                    shares[4, k] = _ONE - fu - w10
                    iu, iv = np.int32(u), np.int32(v)
                    row0 = level_at + ((iv & mask) << bits)
                    row1 = level_at + (((iv + 1) & mask) << bits)
                    c0, c1 = iu & mask, (iu + 1) & mask
                    places[1, k] = row0 + c0
                    places[2, k] = row0 + c1
                    places[3, k] = row1 + c0
                    places[4, k] = row1 + c1
                noise_from = (noise_at + first) & (GRAIN - 1)
                for k in range(last - first):
                    p = places[0, k]
                    q = p + cells_s
                    color = (
                        four_at(light, p) * shares[0, k]
                        + four_at(light, p + 1) * shares[1, k]
                        + four_at(light, q) * shares[2, k]
                        + four_at(light, q + 1) * shares[3, k]
                    )
                    color = (color + own) * steps
                    if picture != 0:
                        texel = (
                            four_at(atlas, places[1, k]) * shares[4, k]
                            + four_at(atlas, places[2, k]) * shares[5, k]
                            + four_at(atlas, places[3, k]) * shares[6, k]
                            + four_at(atlas, places[4, k]) * shares[7, k]
                        )
                        color = color * (texel * _PER_STORED)
                    red, green, blue = first_three_steps(color * four_at(grain, noise_from + k), TONES - 1)
                    colors[k, 0] = tones[red]
                    colors[k, 1] = tones[green]
                    colors[k, 2] = tones[blue]
                first = last
            column = end


@compiled
def grain_start(seed: Any, row: Any) -> Any:
    """Return the row of `grain` where the noise of an image's row begins, by integer arithmetic alone."""
    mixed = (np.uint64(seed) + np.uint64(row) * np.uint64(0x9E3779B9)) & np.uint64(0xFFFFFFFF)
    mixed = (mixed ^ (mixed >> np.uint64(16))) * np.uint64(0x45D9F3B) & np.uint64(0xFFFFFFFF)
    return np.int64((mixed ^ (mixed >> np.uint64(16))) & np.uint64(GRAIN - 1))


@compiled
def _shade_sky(  # noqa: PLR0913 - compiled functions take arrays, not objects
    row: Any,
    column: Any,
    end: Any,
    bx: Any,
    by: Any,
    bz: Any,
    axes: Any,
    focal: Any,
    centre_x: Any,
    picture: Any,
    atlas: Any,
    tones: Any,
    edge: Any,
    fall_off: Any,
    rgb: Any,
) -> None:
    """Shade a segment of a row that shows the outdoors, by direction alone."""
    for x in range(column, end):
        right = (x - centre_x) / focal
        dx = bx + right * axes[0, 0]
        dy = by + right * axes[0, 1]
        dz = bz + right * axes[0, 2]
        # The quarter turn as a share of the diamond |x| + |y| = 1, without trigonometry.
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
        offset = x - centre_x
        bright = np.float32((edge + fall_off * offset * offset) * OUTDOORS / FULL)
        for channel in range(3):
            low = atlas[p00, channel] * (_ONE - fu) + atlas[p01, channel] * fu
            high = atlas[p10, channel] * (_ONE - fu) + atlas[p11, channel] * fu
            value = (low * (_ONE - fv) + high * fv) * bright
            rgb[row, x, channel] = tones[min(int(value * _PER_LIGHT), TONES - 1)]


@compiled
def soften(rgb: Any) -> None:
    """Blur an image (H, W, 3) uint8 over its direct neighbours in place, as a lens and a Bayer filter do."""
    height, width = rgb.shape[0], rgb.shape[1] * 3
    pixels = rgb.reshape(height, width)
    above, sums = np.empty(width, np.uint16), np.empty(width + 6, np.uint16)
    for k in range(width):
        above[k] = pixels[0, k]
    for row in range(height):
        here, below = pixels[row], pixels[min(row + 1, height - 1)]
        for k in range(width):
            value = np.uint16(here[k])
            sums[k + 3] = np.uint16(above[k] + np.uint16(value + value) + np.uint16(below[k]))
            above[k] = value
        for k in range(3):
            sums[k], sums[width + 3 + k] = sums[k + 3], sums[width + k]
        for k in range(width):
            middle = np.uint16(sums[k + 3] + sums[k + 3])
            here[k] = np.uint8(np.uint16(sums[k] + middle + sums[k + 6] + np.uint16(8)) >> np.uint16(4))


@compiled
def mark_out_of_range(depth: Any, nearest: Any, farthest: Any) -> None:
    """Set depth (H, W) outside a sensor's range to NaN."""
    height, width = depth.shape
    for row in range(height):
        for column in range(width):
            value = depth[row, column]
            depth[row, column] = value if nearest <= value <= farthest else np.float32(np.nan)


@compiled
def label_pixels(seen: Any, owner: Any, instances: Any, instance: Any) -> None:
    """Write the object of every pixel into `instance` (H, W), 0 without a surface; `seen` is from `draw_faces`."""
    height, width = seen.shape
    for row in range(height):
        column = 0
        while column < width:
            face = seen[row, column]
            end = column + _run_length(seen[row, column:width])
            instance[row, column:end] = instances[owner[face]] if face >= 0 else 0
            column = end


@compiled
def _run_length(ids: Any) -> int:
    """Return the number of leading ids that are equal."""
    for k in range(1, len(ids)):
        if ids[k] != ids[0]:
            return k
    return len(ids)
