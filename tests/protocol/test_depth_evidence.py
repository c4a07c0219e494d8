"""The pixels that must show the path ahead, and the free distance that they prove."""

import numpy as np
import pytest

from vsnbench.protocol.depth_evidence import Evidence, evidence_pixels
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.robots.profiles import load_profile
from vsnbench.values.camera import Camera

RADIUS_M = 0.18
GUARD = DepthGuard()
LEVEL = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.4, depth_max_m=8)
STEEP = LEVEL.model_copy(update={"tilt_deg": -45.0})
UPWARDS = LEVEL.model_copy(update={"tilt_deg": 25.0, "mount_height_m": 0.3})
ABOVE = LEVEL.model_copy(update={"tilt_deg": 50.0, "mount_height_m": 2.0})


def read(camera: Camera, depth_m: np.ndarray) -> Evidence:
    height, width = depth_m.shape
    return evidence_pixels(camera, width, height, RADIUS_M, GUARD).read(depth_m.astype(np.float32), camera)


def image_of(depth_m: float, camera: Camera = LEVEL) -> np.ndarray:
    return np.full((camera.height, camera.width), depth_m)


def in_rows(camera: Camera) -> np.ndarray:
    """Share of columns that are evidence, by row."""
    where = evidence_pixels(camera, camera.width, camera.height, RADIUS_M, GUARD)
    share = np.zeros(camera.height)
    share[where.first_row : where.first_row + where.cells.shape[0]] = (where.cells >= 0).mean(axis=1)
    return share


def test_a_level_camera_must_measure_below_its_horizon_and_may_not_above() -> None:
    share = in_rows(LEVEL)
    assert share[:60].max() == 0
    assert share[90:110].min() > 0.7


def test_a_camera_that_sees_no_floor_must_measure_along_the_rays_through_the_swath() -> None:
    where = evidence_pixels(UPWARDS, 160, 120, RADIUS_M, GUARD)
    assert where.pixels.sum() > 5000
    assert where.first_row < 60


@pytest.mark.parametrize("camera", [STEEP, UPWARDS], ids=["steep", "upwards"])
def test_evidence_is_every_ray_with_a_point_in_the_swath(camera: Camera) -> None:
    where = evidence_pixels(camera, 160, 120, RADIUS_M, GUARD)
    chosen = np.zeros((120, 160), bool)
    chosen[where.first_row : where.first_row + where.cells.shape[0]] = where.cells >= 0
    met = np.zeros_like(chosen)
    for depth_m in np.linspace(0.01, 3.0, 400):
        x, y, z = np.moveaxis(camera.points_in_base(np.full((120, 160), depth_m, np.float32)), 2, 0)
        inside = (x >= RADIUS_M) & (x <= RADIUS_M + GUARD.distance_m) & (abs(y) <= RADIUS_M + GUARD.margin_m)
        met |= inside & (z >= GUARD.min_height_m) & (z <= GUARD.max_height_m)
    middle = np.s_[12:-12, 16:-16]
    assert np.count_nonzero(met[middle]) > 1000
    assert np.mean(chosen[middle] != met[middle]) < 0.02


def test_a_camera_that_looks_over_the_swath_has_no_evidence_and_is_blind() -> None:
    evidence = read(ABOVE, image_of(2.0, ABOVE))
    assert evidence.pixels == 0
    assert evidence.is_blind


@pytest.mark.parametrize("camera", [LEVEL, STEEP, UPWARDS], ids=["level", "steep", "upwards"])
@pytest.mark.parametrize("depth_m", [np.nan, 0.0, np.inf, -1.0, 2000.0])
def test_what_is_no_depth_of_this_camera_is_no_evidence(camera: Camera, depth_m: float) -> None:
    evidence = read(camera, image_of(depth_m, camera))
    assert evidence.valid_share == 0
    assert evidence.is_blind


@pytest.mark.parametrize("camera", [LEVEL, STEEP, UPWARDS], ids=["level", "steep", "upwards"])
def test_half_of_the_pixels_are_enough_wherever_they_lie(camera: Camera) -> None:
    depth_m = image_of(2.0, camera)
    depth_m[np.random.default_rng(0).random(depth_m.shape) < 0.5] = np.nan
    evidence = read(camera, depth_m)
    assert evidence.valid_share == pytest.approx(0.5, abs=0.05)
    assert not evidence.is_blind
    assert not evidence.hides_something


@pytest.mark.parametrize("name", ["turtlebot2", "lola2", "turtlebot4", "create3", "stretch"])
def test_a_leg_nearer_than_the_minimum_range_is_noticed_wherever_it_stands(name: str) -> None:
    profile = load_profile(name)
    camera = profile.camera
    where = evidence_pixels(camera, camera.width, camera.height, profile.base.radius_m, GUARD)
    side_px = round(camera.focal_px * 0.05 / camera.depth_min_m)
    columns = np.flatnonzero((where.cells >= 0).any(axis=0))
    noticed = 0
    places = range(columns[0], columns[-1] - side_px, max(1, side_px // 7))
    for left in places:
        depth_m = np.full((camera.height, camera.width), 2.0, np.float32)
        depth_m[:, left : left + side_px] = np.nan
        evidence = where.read(depth_m, camera)
        assert not evidence.is_blind
        noticed += evidence.hides_something
    assert noticed == len(places)


def test_a_small_dark_object_hides_nothing() -> None:
    camera = load_profile("turtlebot2").camera
    depth_m = np.full((480, 640), 2.0)
    depth_m[350:390, 300:340] = np.nan
    assert read(camera, depth_m).hidden_cells <= 1


def test_missing_depth_along_the_borders_of_the_image_does_not_count() -> None:
    depth_m = image_of(2.0)
    for border in (np.s_[:9], np.s_[-9:], np.s_[:, :12], np.s_[:, -12:]):
        depth_m[border] = np.nan
    assert read(LEVEL, depth_m).valid_share == 1
