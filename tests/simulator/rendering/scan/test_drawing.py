"""Pixels of a scan: depth, colours, holes and labels."""

import hashlib
import itertools

import numpy as np
import pytest

from tests.simulator.scan.rooms import SIZE_M, TABLE_M, of_quads, room
from vsnbench.simulator.rendering.renderer import Eye, camera_axes
from vsnbench.simulator.rendering.scan.drawing import ScanDrawer
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.rendering.scan.raster import CHUNK
from vsnbench.sites.site import SiteObject

WIDTH, HEIGHT, FOCAL = 160, 120, 100.0
EAST = Eye(1.0, 1.5, 1.25, 0.0)


def looked(mesh: ScanMesh, eye: Eye = EAST, objects: tuple[SiteObject, ...] = ()) -> tuple[np.ndarray, ...]:
    drawer = ScanDrawer(mesh)
    drawer.survey(objects)
    at = np.array([eye.x_m, eye.y_m, eye.z_m])
    view = (at, camera_axes(eye), FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    rgb, depth = np.empty((HEIGHT, WIDTH, 3), np.uint8), np.empty((HEIGHT, WIDTH), np.float32)
    instance = np.empty((HEIGHT, WIDTH), np.int32)
    drawer.look(view, rgb, depth)
    assert np.array_equal(depth, drawer.measure(view, depth.shape), equal_nan=True)
    drawer.label(view, depth, instance)
    return rgb, depth, instance


def test_a_wall_is_as_far_as_it_is() -> None:
    _, depth, _ = looked(room())
    assert depth[60, 80] == pytest.approx(3.0, abs=1e-6)
    assert depth[119, 80] == pytest.approx(1.25 / ((119 - 59.5) / FOCAL), rel=1e-6)  # the floor
    assert not np.isnan(depth).any()


def test_both_sides_of_a_surface_are_drawn() -> None:
    _, depth, _ = looked(room(), Eye(-1.0, 1.5, 1.25, 0.0))
    assert depth[60, 80] == pytest.approx(1.0, abs=1e-6)


def test_colours_of_a_texture_are_where_they_belong_in_perspective() -> None:
    eye = Eye(3.0, 1.5, 1.25, 0.7)
    rgb, depth, _ = looked(room(), eye)
    axes = camera_axes(eye)
    for row, column in ((40, 20), (60, 100), (70, 150), (50, 60)):
        ray = axes[2] + axes[0] * (column - 79.5) / FOCAL + axes[1] * (row - 59.5) / FOCAL
        x, y, z = np.array([eye.x_m, eye.y_m, eye.z_m]) + ray * depth[row, column]
        u = y / SIZE_M[1] if abs(x - SIZE_M[0]) < 1e-3 else 1 - x / SIZE_M[0]
        on_red = (int(u * 8) + int((1 - z / SIZE_M[2]) * 8)) % 2 == 0
        assert (rgb[row, column, 0] > rgb[row, column, 2]) == on_red


def test_a_texture_that_is_too_fine_for_its_pixels_becomes_its_mean() -> None:
    wall = of_quads(np.array([[(40, -8, 8), (40, 8, 8), (40, 8, -8), (40, -8, -8)]], float))
    first, *_ = looked(wall, Eye(0, 0, 0, 0))
    moved, *_ = looked(wall, Eye(0.13, 0, 0, 0))
    inside = np.s_[50:70, 70:90]
    assert np.abs(first[inside].astype(int) - moved[inside]).max() < 60  # without smaller sizes of the texture, 190


def test_colours_of_corners_are_interpolated() -> None:
    wall = of_quads(np.array([[(2, 1, 1), (2, -1, 1), (2, -1, -1), (2, 1, -1)]], float), textured=False)
    rgb, *_ = looked(wall, Eye(0, 0, 0, 0))
    assert rgb[12, 32].tolist() == pytest.approx([200, 40, 40], abs=6)
    assert rgb[107, 32].tolist() == pytest.approx([200, 200, 40], abs=10)


def test_a_hole_has_no_depth_and_the_colour_of_what_is_around_it() -> None:
    rgb, depth, _ = looked(room(without=("east",), textured=False))
    hole = np.isnan(depth)
    assert hole[60, 80]
    assert 0.05 < hole.mean() < 0.5
    assert rgb[hole].min() > 20
    around = rgb[~hole]
    assert (rgb[hole].mean(axis=0) > around.min(axis=0)).all()
    assert (rgb[hole].mean(axis=0) < around.max(axis=0)).all()


def test_a_surface_that_passes_the_camera_is_cut_at_the_image() -> None:
    _, depth, _ = looked(room(), Eye(1.0, 0.05, 1.25, 0.0))  # the south wall begins behind the camera
    assert not np.isnan(depth).any()
    assert depth[60, 159] == pytest.approx(0.05 / ((159 - 79.5) / FOCAL), rel=1e-4)


def test_pixels_are_the_same_on_every_machine() -> None:
    rgb, depth, _ = looked(room(table=True), Eye(3.3, 2.4, 1.2, -2.3, -0.25))
    assert hashlib.sha256(rgb.tobytes() + depth.tobytes()).hexdigest()[:16] == "aae53efb32ed4736"


def test_labels_come_from_the_volumes_of_the_survey() -> None:
    x0, y0, x1, y1, z = TABLE_M
    size = (x1 - x0, y1 - y0, z)
    table = SiteObject(id="table-1", category="table", position=((x0 + x1) / 2, (y0 + y1) / 2), size_m=size)
    eye = Eye(3.5, 1.1, 1.0, np.pi, -0.2)
    _, depth, instance = looked(room(table=True), eye, (table,))
    _, without, _ = looked(room(), eye)
    is_table = np.abs(depth - without) > 0.1
    assert is_table.sum() > 300
    assert (instance[is_table] == 1).mean() > 0.98
    assert (instance[~is_table] == 0).mean() > 0.98


def test_chunks_behind_what_is_drawn_are_left_out_and_change_no_pixel() -> None:
    steps = np.linspace(-2, 2, 41)
    cells = [
        [(x, b, d), (x, a, d), (x, a, c), (x, b, c)]
        for x in (1.0, 4.0)
        for a, b in itertools.pairwise(steps)
        for c, d in itertools.pairwise(steps)
    ]
    drawer = ScanDrawer(of_quads(np.array(cells, float), textured=False))
    view = (np.zeros(3), camera_axes(Eye(0, 0, 0, 0.1)), 80.0, 63.5, 47.5)

    def drawn() -> tuple[np.ndarray, np.ndarray]:
        rgb, depth = np.empty((96, 128, 3), np.uint8), np.empty((96, 128), np.float32)
        drawer.look(view, rgb, depth)
        return rgb, depth

    chosen = drawn()
    assert chosen[1].max() < 2.0
    is_behind = (drawer._corners[..., 0].min(axis=1) > 3.0).reshape(-1, CHUNK).all(axis=1).repeat(CHUNK)
    assert is_behind.sum() > 1000
    hidden = drawer._corners[is_behind].copy()
    drawer._corners[is_behind, :, 0] = 0.5  # not where its box is: it would be seen if it was drawn
    assert all((one == other).all() for one, other in zip(drawn(), chosen, strict=True))
    drawer._corners[is_behind] = hidden
    drawer._boxes[:, 0], drawer._boxes[:, 1] = -9, 9  # nothing is hidden
    assert all((one == other).all() for one, other in zip(drawn(), chosen, strict=True))
