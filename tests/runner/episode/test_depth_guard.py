"""The depth guard refuses moves into obstacles, and no others."""

import math

import numpy as np
import pytest

from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.depth_guard import Refusal, look_ahead
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

BASE = Base(
    radius_m=0.18,
    height_m=0.6,
    mass_kg=6,
    track_m=0.23,
    wheel_radius_m=0.035,
    max_linear_m_s=0.7,
    max_angular_rad_s=3,
    odometry_rate_hz=50,
)
CAMERA = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6)
GUARD = DepthGuard(distance_m=0.4)


def seeing(depth_m: np.ndarray, camera: Camera = CAMERA) -> Observation:
    rgb = np.zeros((*depth_m.shape, 3), np.uint8)
    return Observation(rgb, depth_m.astype(np.float32), Pose(0, 0), 0.0, camera)


def wall_at(distance_m: float) -> np.ndarray:
    return np.full((120, 160), distance_m)


def test_a_wall_nearer_than_the_distance_blocks() -> None:
    reading = look_ahead(seeing(wall_at(0.57)), BASE, GUARD)
    assert reading.blocked
    assert reading.nearest_m == pytest.approx(0.39, abs=1e-3)


def test_a_wall_farther_than_the_distance_does_not_block() -> None:
    assert not look_ahead(seeing(wall_at(0.59)), BASE, GUARD).blocked


def test_a_camera_that_looks_straight_down_sees_obstacles_ahead_and_not_its_own_base_behind_it() -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": -90.0, "mount_forward_m": 0.2, "horizontal_fov_deg": 90.0})
    behind = np.full((120, 160), 0.6)  # the floor, 0.6 m below the lens
    behind[60:] = 0.3
    reading = look_ahead(seeing(behind, camera), BASE, GUARD)
    assert reading.pixels == 0
    assert not reading.blocked
    ahead = np.full((120, 160), 0.6)
    ahead[:60] = 0.3
    assert look_ahead(seeing(ahead, camera), BASE, GUARD).refusal is Refusal.OBSTACLE


def test_without_valid_depth_the_move_is_refused_as_blind() -> None:
    reading = look_ahead(seeing(wall_at(math.nan)), BASE, GUARD)
    assert (reading.refusal, reading.pixels, reading.valid_share) == (Refusal.BLIND, 0, 0)
    assert reading.text.startswith("blind: 0%")


def test_half_of_the_pixels_suffice_to_move_and_to_see_an_obstacle() -> None:
    holes = np.random.default_rng(0).random((120, 160)) < 0.5
    assert not look_ahead(seeing(np.where(holes, math.nan, wall_at(3.0))), BASE, GUARD).blocked
    assert look_ahead(seeing(np.where(holes, math.nan, wall_at(0.5))), BASE, GUARD).refusal is Refusal.OBSTACLE


def test_a_wall_in_part_of_the_path_below_the_minimum_range_is_refused() -> None:
    depth_m = wall_at(3.0)
    depth_m[:, 60:100] = math.nan
    assert look_ahead(seeing(depth_m), BASE, GUARD).refusal is Refusal.TOO_NEAR


def test_invalid_depth_above_the_horizon_refuses_nothing() -> None:
    depth_m = wall_at(3.0)
    depth_m[:60] = math.nan
    assert not look_ahead(seeing(depth_m), BASE, GUARD).blocked


def test_a_few_noisy_pixels_are_not_an_obstacle() -> None:
    depth = wall_at(3.0)
    depth[60, 80 : 80 + GUARD.min_pixels - 1] = 0.5
    assert not look_ahead(seeing(depth), BASE, GUARD).blocked
    depth[60, 79] = 0.5
    assert look_ahead(seeing(depth), BASE, GUARD).blocked


def test_an_object_next_to_the_swath_does_not_block() -> None:
    depth = wall_at(3.0)
    columns = np.arange(160)
    outside_path = np.abs((columns - 79.5) / CAMERA.focal_px * 0.5) > BASE.radius_m + GUARD.margin_m
    depth[:, outside_path] = 0.5
    assert outside_path.any()
    assert not look_ahead(seeing(depth), BASE, GUARD).blocked


def test_the_floor_seen_by_a_tilted_camera_does_not_block() -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": -50.0})
    rows = (np.arange(120) - 59.5) / camera.focal_px
    tilt = math.radians(camera.tilt_deg)
    falling = math.cos(tilt) * rows - math.sin(tilt)
    depth = np.repeat((camera.mount_height_m / falling)[:, None], 160, axis=1)
    ahead = depth[:, 0] * (math.cos(tilt) + math.sin(tilt) * rows)
    assert (ahead < BASE.radius_m + GUARD.distance_m).any()
    assert not look_ahead(seeing(depth, camera), BASE, GUARD).blocked


def test_a_camera_mounted_behind_the_axis_sees_the_same_wall_farther() -> None:
    camera = CAMERA.model_copy(update={"mount_forward_m": -0.1})
    assert not look_ahead(seeing(wall_at(0.69), camera), BASE, GUARD).blocked
    assert look_ahead(seeing(wall_at(0.67), camera), BASE, GUARD).blocked


def test_a_guard_that_is_off_never_blocks() -> None:
    assert not look_ahead(seeing(wall_at(0.3)), BASE, DepthGuard(enabled=False)).blocked


@pytest.mark.parametrize("tilt_deg", [0.0, -25.0, 12.5])
def test_the_guard_counts_the_pixels_that_the_geometry_predicts(tilt_deg: float) -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": tilt_deg, "mount_forward_m": 0.07})
    rng = np.random.default_rng(5)
    seen = 0
    for spread_m in (0.7, 1.5, 6.0):
        depth_m = (rng.random((120, 160)) * spread_m).astype(np.float32)
        depth_m[rng.random((120, 160)) < 0.2] = np.nan
        rays = camera.rays(160, 120)
        rows, columns = rays.pixels_nearer(depth_m, BASE.radius_m + GUARD.distance_m)
        ahead, left, up = rays.points(depth_m[rows, columns], rows, columns)
        inside = np.abs(left) <= BASE.radius_m + GUARD.margin_m
        inside &= (up >= GUARD.min_height_m) & (up <= GUARD.max_height_m)
        reading = look_ahead(seeing(depth_m, camera), BASE, GUARD)
        seen += reading.pixels
        assert reading.pixels == np.count_nonzero(inside)
        assert reading.nearest_m == (ahead[inside].min() - BASE.radius_m if inside.any() else None), "to the last bit"
    assert seen > 500
