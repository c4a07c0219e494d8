"""Fit of the floor plane in a depth image: height, tilt and roll of the camera with uncertainties.

The inverse depth of a plane is linear in the rays of the pixels: 1/d = q0 + q1 left + q2 down. The three numbers give
tilt, roll, and the height in the depth scale of the camera: a 5 % lower camera and a 5 % shorter depth scale give the
same image, and a wrong focal length nearly the same. The position ahead of the base does not change the image.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.values.camera import Camera

Floats = npt.NDArray[np.float64]

SYSTEMATIC_ANGLE_DEG = 0.25
"""Systematic standard deviation of tilt and roll, from rugs and depth that is not flat."""
SYSTEMATIC_HEIGHT_M = 0.005
SYSTEMATIC_SCALE = 0.01
"""Relative standard deviation of the depth scale, which also scales the height."""
_REACH_M = 5.0
"""Longest distance of used points: the noise of depth cameras grows with its square."""
_MOST_POINTS = 20_000
_HYPOTHESES = 2000
_REFINED = 12
_MOST_SEARCHED = 3000
"""Numbers of planes through three random points, of refined planes, and of points for comparison."""
_MOST_TURN_RAD = math.radians(12)
"""Largest difference of tilt and roll from the profile."""
_HEIGHTS = (0.45, 1.7)
"""Range of the height as multiples of the profile's."""
_SHARE_BELOW = 0.03
"""Largest share of points below the floor; otherwise the plane is a table or a stair."""
_LEAST_SHARE = 0.05
"""Smallest share of the image that shows the floor."""
_LEAST_POINTS = 200
_ROUNDS = 12
_BLOCKS = 8
"""Number of blocks in each direction whose errors count as independent."""
_LEAST_BLOCKS = 6
_MOST_SPREAD_RAD = math.radians(0.3)
"""Largest uncertainty of tilt and roll."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A value with its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class FloorPlane:
    """Pose of a camera above the floor in its depth image."""

    height_m: Measured
    tilt_deg: Measured
    """Positive upwards."""
    roll_deg: Measured
    """Positive clockwise, seen from behind the camera."""
    share: float
    """Share of the image that shows the floor."""


class NoFloorError(ValueError):
    """No floor in a depth image; the message is one line."""


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Valid pixels: design matrix (N, 3) of (1, left, down), depth (N,), block (N,) and image size."""

    rays: Floats
    depth_m: Floats
    block: npt.NDArray[np.intp]
    pixels: int
    """Pixels of the thinned image, valid or not."""


def fit_floor(depth_m: npt.NDArray[np.floating], camera: Camera) -> FloorPlane:
    """Fit the floor plane robustly.

    Args:
        depth_m: (H, W) median depth, metres along the optical axis; NaN, infinite or 0 where invalid.
        camera: intrinsics of the image and approximate pose.

    Raises:
        NoFloorError: the image shows too little floor.
    """
    points = _points_of(depth_m, camera)
    if len(points.depth_m) < _LEAST_POINTS:
        raise NoFloorError(f"no floor seen: {_percent(len(points.depth_m), points)} of the image has valid depth")
    plane = _searched(points, camera, np.random.default_rng(0))
    if plane is None:
        raise NoFloorError("no floor seen: no level plane without points below it (stairs, glass or an obstacle)")
    plane, weight = _refined(points, plane)
    if not _plausible(plane, camera):
        raise NoFloorError("no floor seen: the level points ahead do not fit a plane")
    on_floor = weight > 0.25
    share = float(np.count_nonzero(on_floor)) / points.pixels
    blocks = len(np.unique(points.block[on_floor]))
    if share < _LEAST_SHARE or blocks < _LEAST_BLOCKS:
        raise NoFloorError(f"too little floor seen: {share:.1%} of the image")
    covariance = _covariance(points, plane, weight)
    height_m, tilt_rad, roll_rad = _mount(plane)
    jacobian = _jacobian(plane)
    spread = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))
    if spread[1] > _MOST_SPREAD_RAD or spread[2] > _MOST_SPREAD_RAD:
        raise NoFloorError(
            f"too little floor seen: tilt and roll are uncertain by {math.degrees(spread[1:].max()):.1f}°"
        )
    height_std_m = math.hypot(spread[0], SYSTEMATIC_HEIGHT_M, SYSTEMATIC_SCALE * height_m)
    return FloorPlane(
        Measured(height_m, height_std_m),
        Measured(math.degrees(tilt_rad), math.hypot(math.degrees(spread[1]), SYSTEMATIC_ANGLE_DEG)),
        Measured(math.degrees(roll_rad), math.hypot(math.degrees(spread[2]), SYSTEMATIC_ANGLE_DEG)),
        share,
    )


def _percent(count: int, points: _Points) -> str:
    return f"{count / max(points.pixels, 1):.1%}"


def _points_of(depth_m: npt.NDArray[np.floating], camera: Camera) -> _Points:
    height, width = depth_m.shape
    skip = max(1, math.ceil(math.sqrt(height * width / _MOST_POINTS)))
    small = np.asarray(depth_m[skip // 2 :: skip, skip // 2 :: skip], np.float64)
    focal_px = camera.focal_px * width / camera.width
    row, column = np.indices(small.shape)
    left = ((width - 1) / 2 - (column * skip + skip // 2)) / focal_px
    down = (row * skip + skip // 2 - (height - 1) / 2) / focal_px
    farthest_m = min(camera.depth_max_m, _REACH_M)
    with np.errstate(invalid="ignore"):
        valid = np.isfinite(small) & (small > max(camera.depth_min_m, 1e-3)) & (small < farthest_m)
    block = (row * _BLOCKS // small.shape[0]) * _BLOCKS + column * _BLOCKS // small.shape[1]
    rays = np.column_stack([np.ones(valid.sum()), left[valid], down[valid]])
    return _Points(rays, small[valid], block[valid].astype(np.intp), small.size)


def _mount(plane: Floats) -> tuple[float, float, float]:
    """Return height, tilt and roll of the plane q: its normal in the camera's axes is -h * (q0, q1, -q2)."""
    height_m = 1 / float(np.linalg.norm(plane))
    ahead, left, up = -height_m * plane[0], -height_m * plane[1], height_m * plane[2]
    return height_m, math.asin(max(-1.0, min(1.0, ahead))), math.atan2(left, up)


def _jacobian(plane: Floats) -> Floats:
    """Return the (3, 3) derivatives of height, tilt and roll by q."""
    step = 1e-6 * float(np.linalg.norm(plane))
    columns = []
    for number in range(3):
        away = np.zeros(3)
        away[number] = step
        columns.append((np.array(_mount(plane + away)) - np.array(_mount(plane - away))) / (2 * step))
    return np.column_stack(columns)


def _above_m(points: _Points, planes: Floats) -> Floats:
    """Return the heights (N, K) of the points above (K, 3) planes, metres."""
    height_m = 1 / np.linalg.norm(planes, axis=1)
    return np.asarray(height_m * (1 - points.depth_m[:, None] * (points.rays @ planes.T)))


def _noise_m(points: _Points, height_m: float) -> Floats:
    """Return the standard deviations (N,) of the heights of floor points."""
    return np.asarray(height_m * (0.0025 * points.depth_m + 0.002 / points.depth_m))


def _searched(points: _Points, camera: Camera, rng: np.random.Generator) -> Floats | None:
    """Return the level plane with the most points on it and few below it."""
    thin = np.linspace(0, len(points.depth_m) - 1, min(len(points.depth_m), _MOST_SEARCHED)).astype(int)
    few = _Points(points.rays[thin], points.depth_m[thin], points.block[thin], points.pixels)
    planes = _hypotheses(few, camera, rng)
    if not len(planes):
        return None
    width_m = 0.02 + 2 * _noise_m(few, camera.mount_height_m)[:, None]
    counts = (np.abs(_above_m(few, planes)) < width_m).sum(axis=0)
    best: tuple[int, Floats | None] = (0, None)
    for number in np.argsort(-counts)[:_REFINED]:
        plane, weight = _refined(few, planes[number])
        above_m = _above_m(few, plane[None])[:, 0]
        below = float((above_m < -0.03 - 4 * _noise_m(few, camera.mount_height_m)).mean())
        on_plane = int(np.count_nonzero(weight > 0.25))
        if _plausible(plane, camera) and below < _SHARE_BELOW and on_plane > best[0]:
            best = (on_plane, plane)
    return best[1]


def _hypotheses(points: _Points, camera: Camera, rng: np.random.Generator) -> Floats:
    """Return plausible planes (K, 3) through three points each."""
    # Points close to each other do not determine the tilt.
    chosen = rng.integers(len(points.depth_m), size=(_HYPOTHESES, 3))
    three = points.rays[chosen]
    chosen = chosen[np.abs(np.linalg.det(three)) > 2e-3]
    planes = np.linalg.solve(points.rays[chosen], (1 / points.depth_m[chosen])[..., None])[..., 0]
    return np.asarray(planes[np.array([_plausible(plane, camera) for plane in planes], bool)])


def _plausible(plane: Floats, camera: Camera) -> bool:
    height_m, tilt_rad, roll_rad = _mount(plane)
    lowest, highest = _HEIGHTS
    return (
        min(lowest * camera.mount_height_m, camera.mount_height_m - 0.15) < height_m
        and height_m < max(highest * camera.mount_height_m, camera.mount_height_m + 0.15)
        and abs(tilt_rad - math.radians(camera.tilt_deg)) < _MOST_TURN_RAD
        and abs(roll_rad) < _MOST_TURN_RAD
    )


def _refined(points: _Points, plane: Floats) -> tuple[Floats, Floats]:
    """Return the plane after iteratively reweighted least squares, and the weights (N,), 0 to 1."""
    weight = np.zeros(len(points.depth_m))
    noise = _inverse_noise(points)
    for number in range(_ROUNDS):
        height_m = 1 / float(np.linalg.norm(plane))
        width_m = (0.02 if number < _ROUNDS // 2 else 0.005) + 2 * _noise_m(points, height_m)
        share = np.clip(_above_m(points, plane[None])[:, 0] / width_m, -1, 1)
        weight = (1 - share**2) ** 2  # Tukey's
        weighted = points.rays * (weight / noise**2)[:, None]
        try:
            plane = np.asarray(np.linalg.solve(weighted.T @ points.rays, weighted.T @ (1 / points.depth_m)), np.float64)
        except np.linalg.LinAlgError:
            break
    return plane, weight


def _inverse_noise(points: _Points) -> Floats:
    """Return the standard deviations (N,) of the inverse depth."""
    return np.asarray(0.0025 + 0.002 / points.depth_m**2)


def _covariance(points: _Points, plane: Floats, weight: Floats) -> Floats:
    """Return the (3, 3) covariance of the plane from the residuals of blocks of the image."""
    known = weight / _inverse_noise(points) ** 2
    residual = 1 / points.depth_m - points.rays @ plane
    bread = np.linalg.inv((points.rays * known[:, None]).T @ points.rays)
    pull = points.rays * (known * residual)[:, None]
    sums = np.stack([np.bincount(points.block, pull[:, k], _BLOCKS**2) for k in range(3)], axis=1)
    blocks = len(np.unique(points.block[weight > 0.25]))
    return np.asarray(bread @ (sums.T @ sums) @ bread * blocks / max(blocks - 3, 1))
