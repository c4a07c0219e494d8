"""The pose at which seen points lie on the twin's surfaces: damped least squares, robust, with what surveys err by.

Each valid pixel is a point in the robot's frame; its residual is its distance to the plane of the face that the twin
shows in that pixel. Unknown beside the pose are the depth camera's scale, its tilt, the odometry's error in turning,
and a step for each object and each wall of the survey, all with what they may be as their prior. So the covariance
that is left for the pose says what those errors do to it, which pixels by the thousand would not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from vsnbench.placement.looks import SmallLook
from vsnbench.placement.normal_equations import Floats, NormalEquations, Prior, Rows
from vsnbench.placement.twin import Twin, outward
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site
from vsnbench.simulator.renderer import eye_of

_POSE, _SCALE, _TILT, _TURN = slice(0, 3), 3, 4, 5
_COMMON = 6
_LIMIT = np.array([0.10, 0.10, math.radians(6), 0.02, 0.01, 0.02])
"""No step of a fit is longer: metres, radians, shares."""


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Standard deviations of what is not known exactly."""

    object_m: float = 0.02
    """Of an object's place in the survey, along x and along y."""
    wall_m: float = 0.01
    """Of a wall's place along its normal, and of how much farther off its ends are than its middle."""
    floor_m: float = 0.005
    """Of the camera's height above the floor."""
    scale: float = 0.01
    """Relative, of the depth camera."""
    tilt_rad: float = math.radians(0.5)
    """Of the camera's tilt."""
    turn: float = 0.02
    """Relative, of the odometry's turning."""
    surface_m: float = 0.01
    """Of one stretch of surface against the model of it."""
    stretches: float = 25.0
    """How many independent stretches the pixels of one object or one plane are worth at most."""
    moved: float = 0.1
    """How likely an object has been moved, before anything is seen."""
    moved_m: float = 0.5
    """Standard deviation of its place then, along x and along y."""
    pose_m: float = 0.6
    pose_rad: float = math.radians(40)
    """What is known of the pose without looking."""

    @classmethod
    def of(cls, site: Site) -> Self:
        """Return what a site's survey says of itself, with the rest as usual."""
        return cls(wall_m=site.survey_error_m, object_m=2 * site.survey_error_m)


@dataclass(slots=True)
class FitState:
    """Where the fit has got to."""

    pose: Pose
    """Of the first look."""
    scale: float = 1.0
    tilt_rad: float = 0.0
    turn: float = 0.0
    """The odometry's turns are to be lengthened by this share."""
    steps: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(G, 2) how far each group stands off the survey: an object along x and y; a plane of the building along its
    normal, and a wall's ends beside its middle, one to this side and one to that.
    """
    covariance: Floats = field(default_factory=lambda: np.eye(_COMMON))
    """(6, 6) of the pose, the scale, the tilt and the turning."""

    def pose_of(self, look: SmallLook) -> Pose:
        """Return where a look was taken."""
        return self.pose.compose(
            Pose(look.odometry.x_m, look.odometry.y_m, look.odometry.heading_rad * (1 + self.turn))
        )

    def covariance_of(self, look: SmallLook) -> Floats:
        """Return the (3, 3) covariance of where a look was taken on the spot where the first one was."""
        by_common = np.zeros((3, _COMMON))
        by_common[:, _POSE] = np.eye(3)
        by_common[2, _TURN] = look.odometry.heading_rad
        return np.asarray(by_common @ self.covariance @ by_common.T)


def refine(
    twin: Twin,
    camera: Camera,
    looks: Sequence[SmallLook],
    start: Pose,
    errors: ErrorModel,
    rounds: int,
    widths_m: tuple[float, float],
    left_out: frozenset[int] = frozenset(),
    state: FitState | None = None,
) -> FitState:
    """Fit the pose of the first look, from `start`.

    Args:
        twin: what should be seen.
        camera: the robot's.
        looks: what was seen.
        start: near the solution.
        errors: what may be how far off.
        rounds: of linearisation.
        widths_m: of the robust loss in the first and in the last round.
        left_out: groups that stand elsewhere than the survey says.
        state: to go on from, instead of `start`.
    """
    state = FitState(start, steps=np.zeros((twin.groups, 2))) if state is None else state
    for number in range(rounds):
        share = number / max(rounds - 1, 1)
        width_m = widths_m[0] * (widths_m[1] / widths_m[0]) ** share
        step, own_step = _equations(twin, camera, looks, state, errors, width_m, left_out).step(_LIMIT)
        state.pose = Pose(
            state.pose.x_m + float(step[0]), state.pose.y_m + float(step[1]), state.pose.heading_rad + float(step[2])
        )
        state.scale += float(step[_SCALE])
        state.tilt_rad += float(step[_TILT])
        state.turn += float(step[_TURN])
        state.steps = state.steps + own_step
    return state


def doubt(
    twin: Twin,
    camera: Camera,
    looks: Sequence[SmallLook],
    state: FitState,
    errors: ErrorModel,
    width_m: float,
    left_out: frozenset[int],
) -> Floats:
    """Return the (6, 6) covariance of pose, scale, tilt and turning where a fit has ended.

    Args:
        twin: what should be seen.
        camera: the robot's.
        looks: what was seen.
        state: where the fit has ended.
        errors: what may be how far off.
        width_m: of the robust loss.
        left_out: groups that stand elsewhere than the survey says.
    """
    equations = _equations(twin, camera, looks, state, errors, width_m, left_out)
    objects = np.nonzero(twin.is_object)[0].tolist()
    return equations.doubted(objects, errors.moved, errors.object_m, errors.moved_m)


def _equations(
    twin: Twin,
    camera: Camera,
    looks: Sequence[SmallLook],
    state: FitState,
    errors: ErrorModel,
    width_m: float,
    left_out: frozenset[int],
) -> NormalEquations:
    common = np.array([errors.pose_m, errors.pose_m, errors.pose_rad, errors.scale, errors.tilt_rad, errors.turn])
    own_m = np.where(twin.is_object, errors.object_m, np.where(twin.is_floor, errors.floor_m, errors.wall_m))
    rows = [_rows_of(twin, camera, look, state, errors, width_m, left_out) for look in looks]
    now = np.array([0.0, 0.0, 0.0, state.scale - 1.0, state.tilt_rad, state.turn])
    prior = Prior(common, np.repeat(own_m[:, None], 2, axis=1), errors.stretches)
    return NormalEquations(rows, prior, now, state.steps)


def _rows_of(
    twin: Twin,
    camera: Camera,
    look: SmallLook,
    state: FitState,
    errors: ErrorModel,
    width_m: float,
    left_out: frozenset[int],
) -> Rows:
    pose = state.pose_of(look)
    view = twin.drawer.draw(eye_of(camera, pose), look.pinhole)
    with np.errstate(invalid="ignore"):
        gap = look.depth_m * state.scale - view.depth_m
        close = np.abs(gap) < np.maximum(4 * width_m, 0.05) + 0.1 * view.depth_m
    row, column = np.nonzero(close & (view.face >= 0))
    face = view.face[row, column]
    if left_out:
        kept = ~np.isin(twin.group_of[face], list(left_out))
        row, column, face = row[kept], column[kept], face[kept]
    depth_m = look.depth_m[row, column] * state.scale
    tilt_rad = math.radians(camera.tilt_deg) + state.tilt_rad
    cos_t, sin_t = math.cos(tilt_rad), math.sin(tilt_rad)
    down, left = look.down[row], -look.across[column]
    ahead, up = cos_t + sin_t * down, sin_t - cos_t * down
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    forward_m, left_m = camera.mount_forward_m + depth_m * ahead, depth_m * left
    height_m = camera.mount_height_m + depth_m * up
    normal = twin.normals[face]
    nx, ny, nz = normal[:, 0], normal[:, 1], normal[:, 2]
    x_m = pose.x_m + cos * forward_m - sin * left_m
    y_m = pose.y_m + sin * forward_m + cos * left_m
    # Normals in the robot's frame, for what is measured there.
    n_ahead, n_left = cos * nx + sin * ny, cos * ny - sin * nx
    group = twin.group_of[face].astype(np.intp)
    building = ~twin.is_object[group]
    middle, reach_m = twin.middle[group], twin.half_length_m[group]
    to_x, to_y = outward(normal).T
    side = np.where(building & (nx * to_x + ny * to_y < 0), 1.0, -1.0)
    aside = (-to_y * (x_m - middle[:, 0]) + to_x * (y_m - middle[:, 1])) / reach_m
    own = np.column_stack([np.where(building, side, -nx), np.where(building, side * aside, -ny)])
    residual_m = nx * x_m + ny * y_m + nz * height_m - twin.plane_m[face]
    residual_m += (own * state.steps[group]).sum(axis=1)
    common = np.empty((len(face), _COMMON))
    common[:, 0], common[:, 1] = nx, ny
    first_x, first_y = x_m - state.pose.x_m, y_m - state.pose.y_m
    common[:, 2] = ny * first_x - nx * first_y
    along_ray = n_ahead * ahead + n_left * left + nz * up
    common[:, _SCALE] = along_ray * depth_m / state.scale
    common[:, _TILT] = depth_m * (n_ahead * (cos_t * down - sin_t) + nz * (cos_t + sin_t * down))
    common[:, _TURN] = (ny * (x_m - pose.x_m) - nx * (y_m - pose.y_m)) * look.odometry.heading_rad
    noise_m = (0.002 + 0.0015 * depth_m**2) * np.abs(along_ray)
    variance = errors.surface_m**2 + noise_m**2
    robust = (width_m**2 / (width_m**2 + residual_m**2)) ** 2
    return Rows(residual_m, common, group, own, robust / variance)
