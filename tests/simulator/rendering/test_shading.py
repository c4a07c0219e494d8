"""Shading of pixels in parallel gives the same result as scalar arithmetic."""

import numpy as np
import numpy.typing as npt
import pytest

from tests.simulator.rendering.test_renderer import CAMERA, furnished
from vsnbench.simulator.rendering.renderer import DepthDrawer, Eye, Frame, Pinhole, Renderer, _seed_of, eye_of
from vsnbench.simulator.rendering.shading import GRAIN, STRETCH, TONES, VIGNETTE, grain_start, soften
from vsnbench.simulator.rendering.textures import FULL, LEVELS, SIZE, SKY
from vsnbench.simulator.scene import build_scene
from vsnbench.values.pose import Pose


@pytest.mark.parametrize("pose", [Pose(1.0, 1.0, 0.5), Pose(4.2, 3.2, -2.0), Pose(1.5, 3.5, -0.9)])
def test_surface_pixels_equal_scalar_arithmetic(pose: Pose) -> None:
    renderer = Renderer(build_scene(furnished()))
    frame, eye = renderer.render(CAMERA, pose), eye_of(CAMERA, pose)
    pinhole = Pinhole(CAMERA.width, CAMERA.height, CAMERA.focal_px, *CAMERA.center_px)
    faces = DepthDrawer(renderer._mesh).draw(eye, pinhole).face
    rgb, shaded = shade_alone(renderer, eye, frame, faces)
    assert np.count_nonzero(shaded) > 0.9 * shaded.size
    inner = shaded.copy()
    for dy, dx in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)):
        inner &= np.roll(shaded, (dy, dx), (0, 1))
    assert np.count_nonzero(inner) > 0.8 * inner.size
    assert np.array_equal(frame.rgb[inner], softened(rgb)[inner])


def test_softening_equals_the_sum_over_nine_pixels() -> None:
    image = np.random.default_rng(0).integers(0, 256, (7, 9, 3)).astype(np.uint8)
    expected = softened(image)
    soften(image)
    assert np.array_equal(image, expected)


def test_noise_differs_between_poses_and_repeats_for_the_same_pose() -> None:
    renderer, pose = Renderer(build_scene(furnished())), Pose(1.0, 1.0, 0.5)
    assert np.array_equal(renderer.look(CAMERA, pose).rgb, renderer.render(CAMERA, pose).rgb)
    seed = _seed_of(eye_of(CAMERA, pose))
    assert seed == _seed_of(eye_of(CAMERA, Pose(1.0, 1.0, 0.5 + 1e-9))), "rounding errors do not change the noise"
    assert seed != _seed_of(eye_of(CAMERA, Pose(1.001, 1.0, 0.5)))
    starts = {int(grain_start(7, row)) for row in range(100)}
    assert len(starts) > 90
    assert all(0 <= start < GRAIN for start in starts)


def softened(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return the image (H, W, 3), each pixel averaged with its neighbours by the weights 1, 2, 1 along both sides."""
    wide = np.pad(image, ((1, 1), (1, 1), (0, 0)), "edge").astype(int)
    rows = wide[:-2] + 2 * wide[1:-1] + wide[2:]
    return np.asarray((rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:] + 8) >> 4, np.uint8)


def shade_alone(
    renderer: Renderer, eye: Eye, frame: Frame, faces: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_]]:
    """Return the colours (H, W, 3) of all pixels that show a surface, computed by the textbook, and which those are."""
    mesh, light = renderer._mesh, renderer._light
    height, width = faces.shape
    focal, cx, cy = CAMERA.focal_px, (width - 1) / 2, (height - 1) / 2
    cos, sin, level, rise = np.cos(eye.heading_rad), np.sin(eye.heading_rad), np.cos(eye.tilt_rad), np.sin(eye.tilt_rad)
    right, down = np.array([sin, -cos, 0.0]), np.array([cos * rise, sin * rise, -level])
    forward, at = np.array([cos * level, sin * level, rise]), np.array([eye.x_m, eye.y_m, eye.z_m])
    tones, atlas, level_start = renderer._tones, renderer._atlas.astype(np.float32), renderer._levels
    rgb = np.zeros((height, width, 3), np.uint8)
    shown = (faces >= 0) & (mesh.texture[faces] != SKY)
    f32 = np.float32
    fall_off = -VIGNETTE / (cx * cx + cy * cy + 1)
    for row in range(height):
        noise_at = grain_start(_seed_of(eye), row)
        edge = 1 + fall_off * (row - cy) * (row - cy)
        ahead = forward + (row - cy) / focal * down
        column = 0
        while column < width:
            face, first = faces[row, column], column
            run = first
            while run < width and faces[row, run] == face:
                run += 1
            column = run
            if not shown[row, first]:
                continue
            s_axis, t_axis, picture, thing = mesh.axis_s[face], mesh.axis_t[face], mesh.texture[face], mesh.owner[face]
            (map_s, off_s, map_t, off_t), place = mesh.texture_map[face], light.place[face]
            for start in range(first, run, STRETCH):
                end = min(run, start + STRETCH)
                z = frame.depth_m[row, start:end].astype(np.float64)
                offset = np.arange(start, end) - cx
                s = dot(s_axis, at) + z * (dot(s_axis, ahead) + dot(s_axis, right) / focal * offset)
                t = dot(t_axis, at) + z * (dot(t_axis, ahead) + dot(t_axis, right) / focal * offset)
                wide, high = light.size[face]
                ls = np.clip(s * place[0] + place[1], 0, wide - 1)
                lt = np.clip(t * place[2] + place[3], 0, high - 1)
                i, j = np.minimum(ls.astype(int), wide - 2), np.minimum(lt.astype(int), high - 2)
                cells = light.start[face] + j * wide + i
                corners = (cells, cells + 1, cells + wide, cells + wide + 1)
                color = between(light.values, corners, (ls - i).astype(f32), (lt - j).astype(f32))
                middle = (start + end) * 0.5 - cx
                to_steps = f32((edge + fall_off * middle * middle) * (TONES / 2))
                color = (color + f32(mesh.glow[thing])) * (mesh.colors[thing].astype(f32) * to_steps)
                if picture != 0:
                    centre = (start + end) // 2
                    far = frame.depth_m[row, centre if centre < run else start]
                    normal = mesh.normals[face]
                    tilt = abs(dot(normal, ahead) + dot(normal, right) / focal * ((start + end) * 0.5 - cx))
                    footprint = far / focal / np.sqrt(max(tilt, 0.02)) * np.sqrt(map_s * map_t) * SIZE
                    size_level = 0
                    while footprint > 1.4 and size_level < LEVELS - 1:
                        footprint, size_level = footprint * 0.5, size_level + 1
                    size = SIZE >> size_level
                    u, v = (s * map_s + off_s) * size - 0.5, (t * map_t + off_t) * size - 0.5
                    iu, iv = np.floor(u).astype(int), np.floor(v).astype(int)
                    base = picture * ((4 * SIZE * SIZE - 1) // 3) + level_start[size_level]
                    texels = tuple(base + ((iv + b) % size) * size + (iu + a) % size for b in (0, 1) for a in (0, 1))
                    color = color * (between(atlas, texels, (u - iu).astype(f32), (v - iv).astype(f32)) * f32(1 / FULL))
                noise = renderer._grain[((noise_at + start) & (GRAIN - 1)) + np.arange(end - start), :3]
                steps = np.minimum((color * noise).astype(int), TONES - 1)
                rgb[row, start:end] = tones[steps]
    return rgb, shown


def dot(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """Return the inner product, summed from the left."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def between(
    table: npt.NDArray[np.float32],
    corners: tuple[npt.NDArray[np.int64], ...],
    fs: npt.NDArray[np.float32],
    ft: npt.NDArray[np.float32],
) -> npt.NDArray[np.float32]:
    """Return what lies between four rows of a table, (N, 3)."""
    both = fs * ft
    shares = (np.float32(1) - fs - (ft - both), fs - both, ft - both, both)
    parts = [table[corner, :3] * share[:, None] for corner, share in zip(corners, shares, strict=True)]
    return np.asarray(parts[0] + parts[1] + parts[2] + parts[3])
