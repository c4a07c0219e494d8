"""Back-projection of pixels and images agrees at any resolution and with plain geometry."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.values.camera import Camera

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6, mount_forward_m=-0.087, tilt_deg=-12.0)


def by_hand(camera: Camera, row: float, column: float, depth_m: float) -> tuple[float, float, float]:
    """A rotation about the base's y axis, written out."""
    cx, cy = camera.center_px
    right, down = (column - cx) / camera.focal_px, (row - cy) / camera.focal_px
    tilt = math.radians(camera.tilt_deg)
    forward = depth_m * (math.cos(tilt) + down * math.sin(tilt))
    up = depth_m * (math.sin(tilt) - down * math.cos(tilt))
    return forward + camera.mount_forward_m, -depth_m * right, up + camera.mount_height_m


@settings(deadline=None)
@given(st.integers(0, 47), st.integers(0, 63), st.floats(0.1, 8.0), st.floats(-90, 50))
def test_a_pixel_lies_where_plain_geometry_puts_it(row: int, column: int, depth_m: float, tilt_deg: float) -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": tilt_deg})
    found = camera.rays(64, 48).points(np.array([depth_m]), np.array([row]), np.array([column]))
    assert [float(axis[0]) for axis in found] == pytest.approx(by_hand(camera, row, column, depth_m), abs=1e-9)


def test_a_whole_image_and_chosen_pixels_are_the_same_points() -> None:
    depth_m = np.random.default_rng(3).uniform(0.3, 6.0, (48, 64)).astype(np.float32)
    depth_m[10, 20] = np.nan
    whole = CAMERA.points_in_base(depth_m)
    rows, columns = np.nonzero(np.isfinite(depth_m))
    chosen = np.column_stack(CAMERA.rays(64, 48).points(depth_m[rows, columns], rows, columns))
    assert whole[rows, columns] == pytest.approx(chosen, abs=1e-5)
    assert np.isnan(whole[10, 20]).all()


def test_half_the_resolution_sees_the_same_wall_in_the_same_place() -> None:
    wall = np.full((48, 64), 2.0, np.float32)
    full, half = CAMERA.points_in_base(wall), CAMERA.points_in_base(wall[::2, ::2])
    for corner in ((0, 0), (-1, -1)):
        assert half[corner] == pytest.approx(full[corner], abs=0.05)


def test_what_is_nearer_than_a_line_ahead_is_found_and_invalid_depth_is_not() -> None:
    depth_m = np.full((48, 64), 3.0, np.float32)
    depth_m[30, 5], depth_m[31, 6] = 0.5, np.nan
    rows, columns = CAMERA.rays(64, 48).pixels_nearer(depth_m, 1.0)
    assert (rows.tolist(), columns.tolist()) == ([30], [5])
