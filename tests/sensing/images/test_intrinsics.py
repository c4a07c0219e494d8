"""Images are rectified to the ideal camera: exact geometry, no mixed depth, ideal images unchanged."""

import math
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.sensing.images.intrinsics import CalibrationError, Intrinsics
from vsnbench.sensing.images.rectifier import Rectifier, is_of_own_size, rectifier_of
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Attitude

CAMERA = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6)
BENT = (0.1, -0.15, 0.001, -0.001, 0.02)
FISHEYE = (0.02, -0.01, 0.001, 0.0)


def info(intrinsics: Intrinsics, generation: int = 1, **other: Any) -> Any:
    """Return them as a camera_info message of a ROS generation."""
    one = intrinsics
    k = [one.focal_x_px, 0.0, one.center_x_px, 0.0, one.focal_y_px, one.center_y_px, 0.0, 0.0, 1.0]
    p = [one.focal_x_px, 0.0, one.center_x_px, 0.0, 0.0, one.focal_y_px, one.center_y_px, 0.0, 0.0, 0.0, 1.0, 0.0]
    model = one.distortion_model or "plumb_bob"
    fields = {"K": k, "D": list(one.distortion), "P": p} | other
    fields = {name if generation == 1 else name.lower(): value for name, value in fields.items()}
    return SimpleNamespace(width=one.width, height=one.height, distortion_model=model, **fields)


def ideal() -> Intrinsics:
    return Intrinsics(160, 120, CAMERA.focal_px, CAMERA.focal_px, *CAMERA.center_px)


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_an_image_of_the_ideal_camera_is_only_turned_upright(turns: int) -> None:
    upright = np.random.default_rng(0).integers(0, 255, (120, 160, 3)).astype(np.uint8)
    raw = np.ascontiguousarray(np.rot90(upright, turns))
    height, width = raw.shape[:2]
    same = Intrinsics(width, height, CAMERA.focal_px, CAMERA.focal_px, (width - 1) / 2, (height - 1) / 2)
    rectifier = Rectifier(CAMERA, same, turns)
    assert not rectifier.resamples
    assert np.array_equal(rectifier.image(raw), upright)
    assert np.array_equal(rectifier.labels(raw[..., 0]), upright[..., 0])


@settings(deadline=None, max_examples=40)
@given(
    focal=st.floats(0.92, 1.08),
    center_x_px=st.floats(-8, 8),
    center_y_px=st.floats(-8, 8),
    roll_deg=st.floats(-6, 6),
    lens=st.sampled_from([("", ()), ("plumb_bob", BENT), ("equidistant", FISHEYE)]),
    turns=st.integers(0, 3),
    right=st.floats(-0.35, 0.35),
    down=st.floats(-0.25, 0.25),
)
def test_a_ray_is_found_where_the_profiles_camera_has_it(
    focal: float,
    center_x_px: float,
    center_y_px: float,
    roll_deg: float,
    lens: tuple[str, tuple[float, ...]],
    turns: int,
    right: float,
    down: float,
) -> None:
    width, height = (120, 160) if turns % 2 else (160, 120)
    real = Intrinsics(
        width,
        height,
        focal * CAMERA.focal_px,
        focal * CAMERA.focal_px,
        (width - 1) / 2 + center_x_px,
        (height - 1) / 2 + center_y_px,
        lens[1],
        lens[0],
    )
    # Where the real camera, rolled and mounted in quarter turns, sees the ray.
    roll = math.radians(roll_deg)
    a = math.cos(roll) * right + math.sin(roll) * down
    b = math.cos(roll) * down - math.sin(roll) * right
    for _ in range(turns):
        a, b = b, -a
    ((column, row),) = real.project(np.array([a]), np.array([b]))
    rows, columns = np.indices((height, width))
    spot = np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / 8)
    rolled = CAMERA.model_copy(update={"roll_deg": roll_deg})
    seen = Rectifier(rolled, real, turns).labels(spot)
    at_row, at_column = (np.indices(seen.shape) * seen).sum(axis=(1, 2)) / max(seen.sum(), 1e-9)
    (cx, cy) = CAMERA.center_px
    inside = 8 < column < width - 8 and 8 < row < height - 8
    if inside and seen.sum() > 20:
        assert at_column == pytest.approx(cx + CAMERA.focal_px * right, abs=1.0)
        assert at_row == pytest.approx(cy + CAMERA.focal_px * down, abs=1.0)


def test_depth_beyond_the_real_image_is_invalid_and_never_mixed() -> None:
    narrow = Intrinsics(160, 120, 1.06 * CAMERA.focal_px, 1.06 * CAMERA.focal_px, *CAMERA.center_px)
    depth_m = np.where(np.indices((120, 160))[1] < 80, 1.0, 3.0).astype(np.float32)
    seen = Rectifier(CAMERA, narrow).depth(depth_m)
    assert set(np.unique(np.round(seen[~np.isnan(seen)], 5))) == {1.0, 3.0}
    assert np.isnan(seen[:, 0]).all()
    assert Rectifier(CAMERA, narrow).image(np.full((120, 160, 3), 9, np.uint8))[60, 0].tolist() == [0, 0, 0]


def test_depth_of_a_plane_is_exact_between_pixels() -> None:
    real = Intrinsics(160, 120, 0.97 * CAMERA.focal_px, 0.97 * CAMERA.focal_px, 82.3, 57.6)
    rows, columns = np.indices((120, 160))

    def plane_m(intrinsics: Intrinsics) -> Any:
        right = (columns - intrinsics.center_x_px) / intrinsics.focal_x_px
        down = (rows - intrinsics.center_y_px) / intrinsics.focal_y_px
        return (1 / (0.5 + 0.1 * right + 0.6 * down)).astype(np.float32)

    seen = Rectifier(CAMERA, real).depth(plane_m(real))
    assert np.nanmax(np.abs(seen / plane_m(ideal()) - 1)[2:-2, 2:-2]) < 1e-4
    assert np.isfinite(seen).mean() > 0.9


@pytest.mark.parametrize("generation", [1, 2])
def test_both_generations_publish_the_same_calibration(generation: int) -> None:
    bent = Intrinsics(160, 120, 139.0, 140.0, 78.0, 61.0, BENT, "plumb_bob")
    assert Intrinsics.of(info(bent, generation), "/camera/color/image_raw") == bent
    flat = Intrinsics.of(info(bent, generation), "/camera/color/image_rect_color")
    assert flat is not None
    assert flat.distortion == ()
    assert Intrinsics.of(info(bent, generation, K=[0.0] * 9), "/camera/color/image_raw") is None


@pytest.mark.parametrize(
    "wrong",
    [
        Intrinsics(160, 120, 139.0, 139.0, 79.5, 59.5, (0.1, 0.2), "plumb_bob"),
        Intrinsics(160, 120, 139.0, 139.0, 79.5, 59.5, (0.1,) * 5, "division"),
        Intrinsics(160, 120, 139.0, 400.0, 79.5, 59.5),
        Intrinsics(160, 120, 139.0, math.nan, 79.5, 59.5),
    ],
    ids=["two coefficients", "unknown model", "not a camera's", "nan"],
)
def test_a_calibration_that_cannot_be_used_is_refused(wrong: Intrinsics) -> None:
    with pytest.raises(CalibrationError, match="/camera/color/image_raw"):
        Intrinsics.of(info(wrong), "/camera/color/image_raw")


@pytest.mark.parametrize(
    ("width", "height", "focal_px"), [(160, 120, 90.0), (160, 90, CAMERA.focal_px)], ids=["field of view", "shape"]
)
def test_a_calibration_of_another_camera_is_refused(width: int, height: int, focal_px: float) -> None:
    other = Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
    with pytest.raises(CalibrationError):
        rectifier_of(other, CAMERA, "/camera/color/image_raw")


def test_a_calibration_at_another_resolution_is_scaled() -> None:
    large = Intrinsics(640, 480, 4 * CAMERA.focal_px, 4 * CAMERA.focal_px, 319.5, 239.5)
    assert not rectifier_of(large, CAMERA, "/camera/color/image_raw").resamples


def fisheye(fov_deg: float, coefficients: tuple[float, ...] = (), width: int = 320, model: str = "equidistant") -> Any:
    """Return a lens by the definition of the equidistant projection: radius is focal length times angle."""
    focal_px = width / 2 / math.radians(fov_deg / 2)
    return Intrinsics(
        width, width * 3 // 4, focal_px, focal_px, (width - 1) / 2, (width * 3 // 4 - 1) / 2, coefficients, model
    )


@pytest.mark.parametrize("generation", [1, 2])
@pytest.mark.parametrize("model", ["equidistant", "fisheye"])
@pytest.mark.parametrize("coefficients", [(), (0.0,) * 4], ids=["none", "zeros"])
@pytest.mark.parametrize("fov_deg", [90.0, 150.0, 160.0, 200.0])
def test_an_equidistant_lens_without_coefficients_is_no_pinhole(
    fov_deg: float, coefficients: tuple[float, ...], model: str, generation: int
) -> None:
    lens = Intrinsics.of(info(fisheye(fov_deg, coefficients, model=model), generation), "/camera/color/image_raw")
    assert lens is not None
    assert lens.horizontal_fov_deg() == pytest.approx(fov_deg, abs=0.01)
    angle_rad, turn_rad = math.radians(40), math.radians(25)
    right, down = (math.tan(angle_rad) * part(turn_rad) for part in (math.cos, math.sin))
    ((column, row),) = lens.project(np.array([right]), np.array([down]))
    radius_px = lens.focal_x_px * angle_rad
    assert column == pytest.approx(lens.center_x_px + radius_px * math.cos(turn_rad), abs=1e-6)
    assert row == pytest.approx(lens.center_y_px + radius_px * math.sin(turn_rad), abs=1e-6)
    rectified = Intrinsics.of(info(fisheye(fov_deg, coefficients, model=model), generation), "/camera/color/image_rect")
    assert rectified is not None
    assert not rectified.is_fisheye


@pytest.mark.parametrize("coefficients", [(0.0,) * 4, FISHEYE, (-0.02, 0.003, 0.0, 0.0)])
def test_a_fisheye_lens_agrees_with_opencv(coefficients: tuple[float, ...]) -> None:
    lens = fisheye(150.0, coefficients)
    rays = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 2))
    k = np.array([[lens.focal_x_px, 0, lens.center_x_px], [0, lens.focal_y_px, lens.center_y_px], [0, 0, 1]])
    points = np.column_stack([rays, np.ones(len(rays))])[None]
    expected, _ = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), k, np.array(coefficients))
    assert np.abs(lens.project(rays[:, 0], rays[:, 1]) - expected[0]).max() < 1e-3
    edge = np.array([[[lens.center_x_px + lens.width / 2, lens.center_y_px]]])
    ((right, _),) = cv2.fisheye.undistortPoints(edge, k, np.array(coefficients))[0]
    assert lens.horizontal_fov_deg() == pytest.approx(2 * math.degrees(math.atan(right)), abs=0.01)


@pytest.mark.parametrize("fov_deg", [150.0, 160.0, 200.0])
def test_a_view_is_cropped_from_a_wider_fisheye_lens(fov_deg: float) -> None:
    """A pattern that is drawn by the angles of its rays appears where a pinhole has these rays."""
    lens = fisheye(fov_deg)
    camera = Camera(width=320, height=240, horizontal_fov_deg=90, mount_height_m=0.6)
    row, column = np.indices((lens.height, lens.width))
    x, y = column - lens.center_x_px, row - lens.center_y_px
    radius = np.maximum(np.hypot(x, y), 1e-9)
    angle = radius / lens.focal_x_px
    seen = np.where(angle < 1.5, np.tan(np.minimum(angle, 1.5)) * x / radius, 99.0)
    rectified = rectifier_of(lens, camera, "/camera/color/image_raw").labels((1000 * seen).astype(np.int32)) / 1000
    expected = (np.indices((240, 320))[1] - camera.center_px[0]) / camera.focal_px
    # The nearest pixel of the lens is at most half of its width away, which is widest for the ray at the corner.
    assert np.abs(rectified - expected)[60:180, 40:280].max() < 0.6 / lens.focal_x_px * (1 + 1.2**2)


@pytest.mark.parametrize(
    ("fov_deg", "wanted_deg", "advised"), [(90.0, 120.0, "at most 90.0"), (145.0, 165.0, "at most 145.0")]
)
def test_a_view_wider_than_the_fisheye_lens_is_refused(fov_deg: float, wanted_deg: float, advised: str) -> None:
    camera = Camera(width=320, height=240, horizontal_fov_deg=wanted_deg, mount_height_m=0.6)
    with pytest.raises(CalibrationError) as refused:
        rectifier_of(fisheye(fov_deg), camera, "/camera/color/image_raw")
    assert advised in str(refused.value.advice)
    assert "\n" not in str(refused.value)


def test_rays_beyond_a_lens_whose_polynomial_folds_are_outside_the_image() -> None:
    """Radius angle - 0.4 angle³ is largest at 0.913 rad; a ray beyond has the radius of another one."""
    lens = fisheye(150.0, (-0.4, 0.0, 0.0, 0.0))
    assert lens.horizontal_fov_deg() == pytest.approx(2 * math.degrees(math.sqrt(1 / 1.2)), abs=0.3)
    inside, outside = lens.project(np.tan(np.array([0.9, 1.2])), np.zeros(2))
    assert 0 <= inside[0] < lens.width
    assert outside[0] > 10 * lens.width


def plane_depth(intrinsics: Intrinsics) -> np.ndarray:
    """Depth image of a wall that is turned and tilted, 2 m ahead on the axis."""
    rows, columns = np.indices((intrinsics.height, intrinsics.width)).astype(np.float64)
    right = (columns - intrinsics.center_x_px) / intrinsics.focal_x_px
    down = (rows - intrinsics.center_y_px) / intrinsics.focal_y_px
    return (2.0 / (1.0 + 0.3 * right - 0.2 * down)).astype(np.float32)


@pytest.mark.parametrize("focal_px", [110.0, 330.0], ids=["wider than the colour", "narrower"])
def test_depth_of_another_size_is_registered_by_both_calibrations(focal_px: float) -> None:
    own = Intrinsics(212, 120, focal_px, focal_px, 100.0, 63.0)
    assert is_of_own_size(own, CAMERA, (212, 120))
    registered = rectifier_of(own, CAMERA, "depth", of_own_size=True).depth(plane_depth(own))
    expected = plane_depth(ideal())
    assert registered.shape == expected.shape
    seen = np.isfinite(registered)
    assert np.abs(registered - expected)[seen].max() < 0.01
    assert seen[60, 80], "both see what is ahead"
    assert seen.all() == (focal_px < CAMERA.focal_px), "outside the view of the depth camera, depth is invalid"


def test_an_image_without_a_calibration_of_its_size_is_not_registered() -> None:
    assert not is_of_own_size(None, CAMERA, (212, 120))
    assert not is_of_own_size(ideal(), CAMERA, (160, 120)), "it has the size of the profile"
    assert not is_of_own_size(ideal(), CAMERA, (80, 60)), "its calibration is for another size"


@pytest.mark.parametrize(("roll_deg", "pitch_deg", "tilt_deg"), [(5, 0, 0), (0, 6, 0), (-6, 4, -25), (4, -5, -10)])
def test_the_floor_is_level_in_images_of_a_leaning_base(roll_deg: float, pitch_deg: float, tilt_deg: float) -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": tilt_deg, "mount_forward_m": 0.3})
    attitude = Attitude(math.radians(roll_deg), math.radians(pitch_deg))
    level = camera.on(attitude)
    rows, columns = np.indices((120, 160))
    (cx, cy) = camera.center_px
    ahead = np.ones_like(rows, float)
    rays = np.stack([(columns - cx) / camera.focal_px, (rows - cy) / camera.focal_px, ahead], -1) @ camera.axes(
        attitude
    )
    depth_m = np.full((120, 160), np.nan, np.float32)
    down = rays[..., 2] < -0.15
    depth_m[down] = level.mount_height_m / -rays[..., 2][down]
    heights_m = level.points_in_base(Rectifier(camera, None, 0, attitude).depth(depth_m))[..., 2]
    assert np.isfinite(heights_m).mean() > 0.1
    assert np.nanmax(np.abs(heights_m)) < 0.02
    assert np.nanmax(np.abs(camera.points_in_base(depth_m)[..., 2])) > 0.03


def test_an_image_of_a_level_base_is_not_resampled() -> None:
    assert not Rectifier(CAMERA, None, 0, Attitude()).resamples
    assert CAMERA.on(Attitude()) == CAMERA.without_roll
