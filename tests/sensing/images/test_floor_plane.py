"""The floor in a depth image gives height, tilt and roll of the camera, or the reason why it does not."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.support.placement_trials import NoisyEye
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.images.floor_plane import NoFloorError, fit_floor
from vsnbench.simulator.rendering.renderer import Eye, camera_axes
from vsnbench.sites.site import load_site
from vsnbench.values.camera import Camera

CAMERA = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.3, depth_max_m=8)


def plane_m(camera: Camera, level_m: float = 0.0) -> npt.NDArray[np.float64]:
    """Return (H, W) the depth of a level plane at some height; NaN where a ray never meets it."""
    cx, cy = camera.center_px
    row, column = np.indices((camera.height, camera.width))
    rays = np.stack([(column - cx) / camera.focal_px, (row - cy) / camera.focal_px, np.ones(row.shape)], -1)
    eye = Eye(0, 0, camera.mount_height_m, 0, np.radians(camera.tilt_deg), np.radians(camera.roll_deg))
    rise = rays @ camera_axes(eye)[:, 2]
    with np.errstate(divide="ignore"):
        depth_m = (level_m - camera.mount_height_m) / rise
    return np.where(depth_m > 0, depth_m, np.nan)


def room(camera: Camera, seed: int, wall_m: float = 4.0) -> npt.NDArray[np.float64]:
    """Return a noisy floor in front of a wall, a fifth of the pixels replaced by clutter above the floor."""
    rng = np.random.default_rng(seed)
    depth_m = np.fmin(plane_m(camera), wall_m)
    clutter = rng.random(depth_m.shape) < 0.2
    depth_m[clutter] *= rng.uniform(0.3, 1.0, clutter.sum())
    depth_m += rng.normal(0, 1, depth_m.shape) * (0.0015 + 0.002 * depth_m**2)
    depth_m[rng.random(depth_m.shape) < 0.1] = np.nan
    return depth_m


@settings(deadline=None, max_examples=25)
@given(
    height_m=st.floats(0.45, 0.75),
    tilt_deg=st.floats(-6, 4),
    roll_deg=st.floats(-5, 5),
    seed=st.integers(0, 99),
)
def test_a_synthetic_floor_gives_the_mount_within_its_uncertainty(
    height_m: float, tilt_deg: float, roll_deg: float, seed: int
) -> None:
    true = CAMERA.model_copy(update={"mount_height_m": height_m, "tilt_deg": tilt_deg, "roll_deg": roll_deg})
    floor = fit_floor(room(true, seed), CAMERA)
    for measured, truth in ((floor.height_m, height_m), (floor.tilt_deg, tilt_deg), (floor.roll_deg, roll_deg)):
        assert abs(measured.value - truth) < 2 * measured.std
    assert floor.tilt_deg.std < 0.4
    assert floor.height_m.std < 0.015


def test_a_depth_scale_has_the_same_effect_as_a_height() -> None:
    short = fit_floor(0.9 * room(CAMERA, 0), CAMERA)
    assert short.height_m.value == pytest.approx(0.54, abs=0.01)
    assert short.tilt_deg.value == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize(
    "depth_m",
    [
        pytest.param(np.full((120, 160), np.nan), id="glass that gives no depth"),
        pytest.param(np.full((120, 160), 1.0), id="a wall"),
        pytest.param(np.where(np.indices((120, 160))[0] > 112, plane_m(CAMERA), 3.0), id="a strip of floor"),
        pytest.param(
            np.fmin(np.where(plane_m(CAMERA) < 1.9, plane_m(CAMERA), plane_m(CAMERA, -0.5)), 6.0), id="stairs down"
        ),
        pytest.param(np.zeros((2, 2)), id="next to no pixels"),
    ],
)
def test_no_floor_is_one_line(depth_m: npt.NDArray[np.float64]) -> None:
    with pytest.raises(NoFloorError) as refused:
        fit_floor(depth_m, CAMERA)
    assert len(str(refused.value).splitlines()) == 1


def test_a_bed_that_fills_the_view_is_not_the_floor() -> None:
    depth_m = np.fmin(np.where(plane_m(CAMERA, 0.25) < 2.2, plane_m(CAMERA, 0.25), plane_m(CAMERA)), 6.0)
    with pytest.raises(NoFloorError):
        fit_floor(np.where(np.indices(depth_m.shape)[0] > 75, depth_m, 2.5), CAMERA)


@pytest.mark.parametrize(
    "off", [{}, {"tilt_deg": 5.0}, {"tilt_deg": -2.0}, {"roll_deg": 3.0}, {"mount_height_m": 0.5}], ids=str
)
def test_the_mount_is_measured_in_the_simulated_apartment(off: dict[str, float]) -> None:
    profile = load_profile("turtlebot2").camera
    true, site = profile.model_copy(update=off), load_site("apartment")
    look = NoisyEye(site, true, 1.0, np.random.default_rng(0)).look(site.starts[4].pose)
    floor = fit_floor(look.depth_m, profile)
    assert floor.height_m.value == pytest.approx(true.mount_height_m, abs=0.01)
    assert floor.tilt_deg.value == pytest.approx(true.tilt_deg, abs=0.3)
    assert floor.roll_deg.value == pytest.approx(true.roll_deg, abs=0.3)
