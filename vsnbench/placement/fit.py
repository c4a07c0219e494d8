"""The pose at which seen points lie on the twin's surfaces: damped least squares, robust, with what surveys err by.

Each valid pixel is a point in the robot's frame; its residual is its distance to the plane of the face that the twin
shows in that pixel. Unknown beside the pose are the depth camera's scale, its tilt, the odometry's error in turning,
and a step for each object and each wall of the survey, all with what they may be as their prior. So the covariance
that is left for the pose says what those errors do to it, which pixels by the thousand would not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from vsnbench.placement.looks import SmallLook
from vsnbench.placement.twin import Twin
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.simulator.renderer import eye_of

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]

_POSE, _SCALE, _TILT, _TURN = slice(0, 3), 3, 4, 5
_COMMON = 6


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Standard deviations of what is not known exactly."""

    object_m: float = 0.02
    """Of an object's place in the survey, along x and along y."""
    wall_m: float = 0.005
    """Of a wall's, the floor's, the ceiling's along its normal."""
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
    """How likely an object has been moved so that nothing but the pose itself shows it."""
    pose_m: float = 0.6
    pose_rad: float = math.radians(40)
    """What is known of the pose without looking."""


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
    """(G, 2) how far each group stands off the survey; a plane's along its normal, in the first number."""
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
    system = _Normal(twin.groups, errors)
    for number in range(rounds):
        share = number / max(rounds - 1, 1)
        width_m = widths_m[0] * (widths_m[1] / widths_m[0]) ** share
        system = _Normal(twin.groups, errors)
        for look in looks:
            system.add(_rows_of(twin, camera, look, state, errors, width_m, left_out))
        system.solve(state)
    state.covariance = system.doubted()
    return state


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The linearised residuals of N pixels."""

    residual_m: Floats
    """(N,) distance beyond the plane, as the state has it."""
    common: Floats
    """(N, 6) derivatives by pose, scale, tilt and turn."""
    group: Ints
    """(N,)."""
    own: Floats
    """(N, 2) derivatives by the group's step."""
    weight: Floats
    """(N,) inverse variance, robust."""


def _rows_of(
    twin: Twin,
    camera: Camera,
    look: SmallLook,
    state: FitState,
    errors: ErrorModel,
    width_m: float,
    left_out: frozenset[int],
) -> _Rows:
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
    building = twin.object_of[face] == 0
    own = np.column_stack([np.where(building, -1.0, -nx), np.where(building, 0.0, -ny)])
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
    return _Rows(residual_m, common, group, own, robust / variance)


class _Normal:
    """The normal equations: common unknowns, and for each group its own, which are eliminated."""

    def __init__(self, groups: int, errors: ErrorModel) -> None:
        self._groups, self._errors = groups, errors
        self._rows: list[_Rows] = []

    def add(self, rows: _Rows) -> None:
        self._rows.append(rows)

    def solve(self, state: FitState) -> None:
        """Take one step."""
        errors, groups = self._errors, self._groups
        group = np.concatenate([rows.group for rows in self._rows])
        common = np.concatenate([rows.common for rows in self._rows])
        own = np.concatenate([rows.own for rows in self._rows])
        weight = np.concatenate([rows.weight for rows in self._rows])
        residual_m = np.concatenate([rows.residual_m for rows in self._rows])
        pixels = np.bincount(group, minlength=groups).astype(float)
        weight = weight * np.minimum(1.0, errors.stretches / np.maximum(pixels, 1.0))[group]

        def summed(values: Floats) -> Floats:
            return np.bincount(group, weight * values, groups).astype(np.float64)

        is_object = np.zeros(groups, bool)
        is_object[group[own[:, 1] != 0]] = True
        prior = np.where(is_object, errors.object_m, errors.wall_m) ** -2.0
        own_own = np.empty((groups, 2, 2))
        own_own[:, 0, 0] = summed(own[:, 0] ** 2) + prior
        own_own[:, 1, 1] = summed(own[:, 1] ** 2) + prior
        own_own[:, 0, 1] = own_own[:, 1, 0] = summed(own[:, 0] * own[:, 1])
        own_right = -np.stack([summed(own[:, k] * residual_m) for k in (0, 1)], axis=1) - prior[:, None] * state.steps
        mixed = np.stack([[summed(common[:, j] * own[:, k]) for k in (0, 1)] for j in range(_COMMON)])  # (6, 2, G)
        mixed = mixed.transpose(2, 0, 1)  # (G, 6, 2)
        weighted = common * weight[:, None]
        inverse = np.linalg.inv(own_own)
        gain = mixed @ inverse  # (G, 6, 2)
        taken, taken_right = gain @ mixed.transpose(0, 2, 1), np.einsum("gik,gk->gi", gain, own_right)
        matrix = weighted.T @ common - taken.sum(axis=0)
        right = -weighted.T @ residual_m - taken_right.sum(axis=0)
        spread = np.array(
            [errors.pose_m, errors.pose_m, errors.pose_rad, errors.scale, errors.tilt_rad, errors.turn], float
        )
        now = np.array([0.0, 0.0, 0.0, state.scale - 1.0, state.tilt_rad, state.turn])
        matrix += np.diag(spread**-2.0)
        right -= spread**-2.0 * now
        step = np.linalg.solve(matrix, right)
        limit = np.array([0.10, 0.10, math.radians(6), 0.02, 0.01, 0.02])
        step *= min(1.0, float(np.min(limit / np.maximum(np.abs(step), 1e-12))))
        own_step = np.einsum("gkl,gl->gk", inverse, own_right - np.einsum("gik,i->gk", mixed, step))
        state.pose = Pose(
            state.pose.x_m + float(step[0]), state.pose.y_m + float(step[1]), state.pose.heading_rad + float(step[2])
        )
        state.scale += float(step[_SCALE])
        state.tilt_rad += float(step[_TILT])
        state.turn += float(step[_TURN])
        state.steps = state.steps + own_step
        self._matrix, self._objects = matrix, np.nonzero(is_object)[0]
        self._said = (group, common, weighted, residual_m, taken, taken_right)

    def doubted(self) -> Floats:
        """Return the (6, 6) covariance of the common unknowns: each object may have been moved, and then misleads.

        It is that of a mixture: with the likelihood of its having been moved, the pose is the one that all but this
        object make, with the covariance that is left then. A pose that hinges on one object is so as unsure as it is.
        """
        covariance = np.linalg.inv(self._matrix)
        widened = covariance.copy()
        group, common, weighted, residual_m, taken, taken_right = self._said
        for one in self._objects:
            here = group == one
            said = weighted[here].T @ common[here] - taken[one]
            without = np.linalg.inv(self._matrix - said)
            away = without @ (weighted[here].T @ residual_m[here] + taken_right[one])
            widened += self._errors.moved * (without - covariance + np.outer(away, away))
        return widened
