"""Fit of the pose by robust, damped least squares, with the errors of survey and camera as unknowns.

Each valid pixel is a point in the robot's frame; its residual is its distance to the plane of the face that the twin
shows in that pixel. Further unknowns are the depth camera's scale and mount (tilt, roll, height, distance ahead of the
base's axis), its focal length, the odometry's error in turning, and an offset of each object and each wall of the
survey, each with a prior. The priors of the camera are the limits of doctor's checks. The covariance of the pose
therefore includes these errors, which thousands of pixels alone would not show.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from vsnbench.localization.looks import LookSet, SmallLook
from vsnbench.localization.normal_equations import Floats, NormalEquations, Rows
from vsnbench.localization.odometry_errors import OdometryErrors, by_errors
from vsnbench.localization.twin import Twin, outward
from vsnbench.sites.site import Site
from vsnbench.values.pose import Pose

_POSE, _SCALE, _TILT, _TURN, _ROLL, _FOCAL, _HEIGHT, _FORWARD = slice(0, 3), 3, 4, 5, 6, 7, 8, 9
_COMMON = 10
_WAY, _VEER = 10, 11
"""Further unknowns of looks between which the robot drove."""
_LIMIT = np.array([0.10, 0.10, math.radians(6), 0.02, 0.01, 0.02, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
"""Maximum step of an iteration: metres, radians, shares, radians per metre."""


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Standard deviations of the uncertain quantities."""

    object_m: float = 0.02
    """Place of an object in the survey, along x and along y."""
    wall_m: float = 0.01
    """Place of a wall along its normal, and deviation of its ends from its middle."""
    floor_m: float = 0.005
    """Height of the floor: rugs, thresholds."""
    scale: float = 0.01
    """Scale of the depth camera, relative."""
    tilt_rad: float = math.radians(0.8)
    """Tilt of the camera; doctor accepts 1 degree."""
    roll_rad: float = math.radians(0.8)
    """Roll of the camera; doctor accepts 1 degree."""
    height_m: float = 0.015
    """Height of the camera; doctor accepts 2 cm."""
    focal: float = 0.008
    """Focal length, relative; doctor accepts 1 % of the field of view."""
    forward_m: float = 0.01
    """Distance of the camera ahead of the base's axis, measured with a tape."""
    forward_turning_m: float = 0.05
    """The same if the images of a turn measure it."""
    turn: float = 0.02
    """Scale of the odometry's turns, relative."""
    way: float = 0.03
    """Scale of the odometry's distances, relative."""
    veer_rad_per_m: float = 0.015
    """Turn per metre of way that the odometry does not measure."""
    wander_rad: float = 0.008
    """Random error of the odometry's headings between the looks of a way, which no unknown of the fit follows."""
    surface_m: float = 0.01
    """Deviation of one independent patch of surface from its model."""
    stretches: float = 25.0
    """Maximum number of independent patches of one object or one plane."""
    moved: float = 0.1
    """Prior probability that an object has been moved."""
    moved_m: float = 0.5
    """Standard deviation of a moved object's place, along x and along y."""
    pose_m: float = 0.6
    pose_rad: float = math.radians(40)
    """Prior knowledge of the pose."""

    @property
    def odometry(self) -> OdometryErrors:
        """Standard deviations of the odometry's errors."""
        return OdometryErrors(self.way, self.turn, self.veer_rad_per_m)

    @classmethod
    def of(cls, site: Site) -> Self:
        """Return the errors with the site's own survey error."""
        return cls(wall_m=site.survey_error_m, object_m=2 * site.survey_error_m)


@dataclass(frozen=True, slots=True, eq=False)
class FitState:
    """Present estimate of all unknowns."""

    pose: Pose
    """Pose of the first look."""
    scale: float = 1.0
    tilt_rad: float = 0.0
    turn: float = 0.0
    """Share by which the odometry's turns must be increased."""
    roll_rad: float = 0.0
    focal: float = 0.0
    """Share by which the focal length is shorter than the camera's."""
    height_m: float = 0.0
    forward_m: float = 0.0
    """Distance of the lens ahead of its place in the camera's mount."""
    way: float = 0.0
    """Share by which the odometry's distances must be increased."""
    veer_rad_per_m: float = 0.0
    steps: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(G, 2) offsets of each group from the survey: an object along x and y; a plane of the building along its normal;
    and the opposite offsets of a wall's two ends.
    """
    covariance: Floats = field(default_factory=lambda: np.eye(_COMMON))
    """(10, 10) covariance of pose, scale, tilt, turning, roll, focal length, height and forward; (12, 12) with way and
    veering for looks between which the robot drove.
    """

    @classmethod
    def at(cls, pose: Pose, twin: Twin) -> Self:
        """Return the initial estimate at `pose`, with everything as surveyed."""
        return cls(pose, steps=np.zeros((twin.groups, 2)))

    def moved(self, step: Floats, own_step: Floats) -> Self:
        """Return the state after a (10,) or (12,) step of the common unknowns and a (G, 2) step of the groups."""
        x_m, y_m, heading_rad, scale, tilt_rad, turn, roll_rad, focal, height_m, forward_m, *drove = step.tolist()
        way, veer_rad_per_m = drove or (0.0, 0.0)
        return replace(
            self,
            pose=Pose(self.pose.x_m + x_m, self.pose.y_m + y_m, self.pose.heading_rad + heading_rad),
            scale=self.scale + scale,
            tilt_rad=self.tilt_rad + tilt_rad,
            turn=self.turn + turn,
            roll_rad=self.roll_rad + roll_rad,
            focal=self.focal + focal,
            height_m=self.height_m + height_m,
            forward_m=self.forward_m + forward_m,
            way=self.way + way,
            veer_rad_per_m=self.veer_rad_per_m + veer_rad_per_m,
            steps=self.steps + own_step,
        )

    @property
    def forward_std_m(self) -> float:
        """Standard deviation of `forward_m`."""
        return math.sqrt(self.covariance[_FORWARD, _FORWARD])

    @property
    def odometry(self) -> OdometryErrors:
        """The odometry's errors in driving."""
        return OdometryErrors(self.way, self.turn, self.veer_rad_per_m)

    def pose_of(self, look: SmallLook) -> Pose:
        """Return the pose of a look."""
        if look.steps:
            return self.pose.compose(Pose(0.0, 0.0).relative_to(self.odometry.driven(look.steps)))
        return self.pose.compose(
            Pose(look.odometry.x_m, look.odometry.y_m, look.odometry.heading_rad * (1 + self.turn))
        )

    def covariance_of(self, look: SmallLook) -> Floats:
        """Return the (3, 3) covariance of a look's pose after a turn on the spot from the first look."""
        by_common = np.zeros((3, len(self.covariance)))
        by_common[:, _POSE] = np.eye(3)
        by_common[2, _TURN] = look.odometry.heading_rad
        return np.asarray(by_common @ self.covariance @ by_common.T)


@dataclass(frozen=True, slots=True, eq=False)
class PoseFit:
    """Inputs of a fit: images, uncertainties, and excluded groups."""

    sighting: LookSet
    errors: ErrorModel
    left_out: frozenset[int] = frozenset()
    """Groups that are not where the survey has them."""

    def refined(self, state: FitState, rounds: int, widths_m: tuple[float, float]) -> FitState:
        """Fit the pose of the first look from an initial state.

        Args:
            state: initial state near the solution.
            rounds: number of linearizations.
            widths_m: width of the robust loss in the first and in the last round.
        """
        for number in range(rounds):
            share = number / max(rounds - 1, 1)
            width_m = widths_m[0] * (widths_m[1] / widths_m[0]) ** share
            state = state.moved(*self._equations(state, width_m).step(_LIMIT[: self._size]))
        return state

    def doubt(self, state: FitState, width_m: float) -> Floats:
        """Return the (10, 10) or (12, 12) covariance of the common unknowns after a fit."""
        objects, errors = np.nonzero(self.sighting.twin.is_object)[0].tolist(), self.errors
        return self._equations(state, width_m).doubted(objects, errors.moved, errors.object_m, errors.moved_m)

    @property
    def _size(self) -> int:
        """Number of common unknowns."""
        return len(_LIMIT) if self.sighting.drove else _COMMON

    def _equations(self, state: FitState, width_m: float) -> NormalEquations:
        twin, errors = self.sighting.twin, self.errors
        turns = len(self.sighting.looks) > 1 and not self.sighting.drove
        forward_m = errors.forward_turning_m if turns else errors.forward_m
        common = np.array(
            [
                *(errors.pose_m, errors.pose_m, errors.pose_rad, errors.scale, errors.tilt_rad, errors.turn),
                *(errors.roll_rad, errors.focal, errors.height_m, forward_m),
                *(errors.way, errors.veer_rad_per_m),
            ]
        )[: self._size]
        own_m = np.where(twin.is_object, errors.object_m, np.where(twin.is_floor, errors.floor_m, errors.wall_m))
        rows = [self._rows_of(look, state, width_m) for look in self.sighting.looks]
        camera = (state.roll_rad, state.focal, state.height_m, state.forward_m)
        drove = (state.way, state.veer_rad_per_m)
        now = np.array([0.0, 0.0, 0.0, state.scale - 1.0, state.tilt_rad, state.turn, *camera, *drove])[: self._size]
        own = np.repeat(own_m[:, None], 2, axis=1)
        return NormalEquations(rows, common, own, errors.stretches, now, state.steps)

    def _rows_of(self, look: SmallLook, state: FitState, width_m: float) -> Rows:
        twin, camera, errors = self.sighting.twin, look.camera, self.errors
        pose = state.pose_of(look)
        view = self.sighting.expected(look, pose)
        with np.errstate(invalid="ignore"):
            gap = look.depth_m * state.scale - view.depth_m
            close = np.abs(gap) < np.maximum(4 * width_m, 0.05) + 0.1 * view.depth_m
        row, column = np.nonzero(close & (view.face >= 0))
        face = view.face[row, column]
        if self.left_out:
            included = ~np.isin(twin.group_of[face], list(self.left_out))
            row, column, face = row[included], column[included], face[included]
        depth_m = look.depth_m[row, column] * state.scale
        tilt_rad = math.radians(camera.tilt_deg) + state.tilt_rad
        cos_t, sin_t = math.cos(tilt_rad), math.sin(tilt_rad)
        down, left = look.down[row] * (1 + state.focal), -look.across[column] * (1 + state.focal)
        down, left = down - left * state.roll_rad, left + down * state.roll_rad
        ahead, up = cos_t + sin_t * down, sin_t - cos_t * down
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        forward_m, left_m = camera.mount_forward_m + state.forward_m + depth_m * ahead, depth_m * left
        height_m = camera.mount_height_m + state.height_m + depth_m * up
        normal = twin.normals[face]
        nx, ny, nz = normal[:, 0], normal[:, 1], normal[:, 2]
        x_m = pose.x_m + cos * forward_m - sin * left_m
        y_m = pose.y_m + sin * forward_m + cos * left_m
        # Normals in the robot's frame, for unknowns in that frame.
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
        common = np.zeros((len(face), self._size))
        common[:, 0], common[:, 1] = nx, ny
        first_x, first_y = x_m - state.pose.x_m, y_m - state.pose.y_m
        common[:, 2] = ny * first_x - nx * first_y
        along_ray = n_ahead * ahead + n_left * left + nz * up
        common[:, _SCALE] = along_ray * depth_m / state.scale
        common[:, _TILT] = depth_m * (n_ahead * (cos_t * down - sin_t) + nz * (cos_t + sin_t * down))
        about_look = ny * (x_m - pose.x_m) - nx * (y_m - pose.y_m)
        if look.steps:
            common[:, [_WAY, _TURN, _VEER]] = _by_odometry(state, look, nx, ny, about_look)
        else:
            common[:, _TURN] = about_look * look.odometry.heading_rad
        common[:, _ROLL] = depth_m * (n_left * down - n_ahead * sin_t * left + nz * cos_t * left)
        common[:, _FOCAL] = depth_m * (n_ahead * sin_t * down + n_left * left - nz * cos_t * down)
        common[:, _HEIGHT], common[:, _FORWARD] = nz, n_ahead
        noise_m = (0.002 + 0.0015 * depth_m**2) * np.abs(along_ray)
        variance = errors.surface_m**2 + noise_m**2
        robust = (width_m**2 / (width_m**2 + residual_m**2)) ** 2
        return Rows(residual_m, common, group, own, robust / variance)


def _by_odometry(state: FitState, look: SmallLook, nx: Floats, ny: Floats, about_look: Floats) -> Floats:
    """Return the (N, 3) derivatives of residuals by way, turn and veering; `about_look` by the look's heading."""
    by = by_errors(look.steps, state.odometry, backward=True)
    cos, sin = math.cos(state.pose.heading_rad), math.sin(state.pose.heading_rad)
    by_x, by_y = cos * by[0] - sin * by[1], sin * by[0] + cos * by[1]
    return np.asarray(nx[:, None] * by_x + ny[:, None] * by_y + about_look[:, None] * by[2])
