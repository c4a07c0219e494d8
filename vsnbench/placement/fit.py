"""The pose at which seen points lie on the twin's surfaces: damped least squares, robust, with what surveys err by.

Each valid pixel is a point in the robot's frame; its residual is its distance to the plane of the face that the twin
shows in that pixel. Unknown beside the pose are the depth camera's scale, its tilt, the odometry's error in turning,
and a step for each object and each wall of the survey, all with what they may be as their prior. So the covariance
that is left for the pose says what those errors do to it, which pixels by the thousand would not.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from vsnbench.placement.looks import Sighting, SmallLook
from vsnbench.placement.normal_equations import Floats, NormalEquations, Prior, Rows
from vsnbench.placement.twin import Twin, outward
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site

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


@dataclass(frozen=True, slots=True, eq=False)
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

    @classmethod
    def at(cls, pose: Pose, twin: Twin) -> Self:
        """Return where a fit begins: at `pose`, with everything as surveyed."""
        return cls(pose, steps=np.zeros((twin.groups, 2)))

    def moved(self, step: Floats, own_step: Floats) -> Self:
        """Return the state after a (6,) step of pose, scale, tilt and turning, and a (G, 2) one of the groups."""
        x_m, y_m, heading_rad, scale, tilt_rad, turn = step.tolist()
        return replace(
            self,
            pose=Pose(self.pose.x_m + x_m, self.pose.y_m + y_m, self.pose.heading_rad + heading_rad),
            scale=self.scale + scale,
            tilt_rad=self.tilt_rad + tilt_rad,
            turn=self.turn + turn,
            steps=self.steps + own_step,
        )

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


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """What a fit goes by: what was seen, what may be how far off, and what it leaves out."""

    sighting: Sighting
    errors: ErrorModel
    left_out: frozenset[int] = frozenset()
    """Groups that stand elsewhere than the survey says."""

    def refined(self, state: FitState, rounds: int, widths_m: tuple[float, float]) -> FitState:
        """Fit the pose of the first look, from `state` on.

        Args:
            state: near the solution.
            rounds: of linearisation.
            widths_m: of the robust loss in the first and in the last round.
        """
        for number in range(rounds):
            share = number / max(rounds - 1, 1)
            width_m = widths_m[0] * (widths_m[1] / widths_m[0]) ** share
            state = state.moved(*self._equations(state, width_m).step(_LIMIT))
        return state

    def doubt(self, state: FitState, width_m: float) -> Floats:
        """Return the (6, 6) covariance of pose, scale, tilt and turning where a fit has ended.

        Args:
            state: where the fit has ended.
            width_m: of the robust loss.
        """
        objects, errors = np.nonzero(self.sighting.twin.is_object)[0].tolist(), self.errors
        return self._equations(state, width_m).doubted(objects, errors.moved, errors.object_m, errors.moved_m)

    def _equations(self, state: FitState, width_m: float) -> NormalEquations:
        twin, errors = self.sighting.twin, self.errors
        common = np.array([errors.pose_m, errors.pose_m, errors.pose_rad, errors.scale, errors.tilt_rad, errors.turn])
        own_m = np.where(twin.is_object, errors.object_m, np.where(twin.is_floor, errors.floor_m, errors.wall_m))
        rows = [self._rows_of(look, state, width_m) for look in self.sighting.looks]
        now = np.array([0.0, 0.0, 0.0, state.scale - 1.0, state.tilt_rad, state.turn])
        prior = Prior(common, np.repeat(own_m[:, None], 2, axis=1), errors.stretches)
        return NormalEquations(rows, prior, now, state.steps)

    def _rows_of(self, look: SmallLook, state: FitState, width_m: float) -> Rows:
        twin, camera, errors = self.sighting.twin, self.sighting.camera, self.errors
        pose = state.pose_of(look)
        view = self.sighting.expected(look, pose)
        with np.errstate(invalid="ignore"):
            gap = look.depth_m * state.scale - view.depth_m
            close = np.abs(gap) < np.maximum(4 * width_m, 0.05) + 0.1 * view.depth_m
        row, column = np.nonzero(close & (view.face >= 0))
        face = view.face[row, column]
        if self.left_out:
            kept = ~np.isin(twin.group_of[face], list(self.left_out))
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
