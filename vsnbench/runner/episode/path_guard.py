"""The depth guard while a robot drives: how much free way it needs ahead, and whether it sees it."""

import math

from vsnbench.control.settings import MotionSettings
from vsnbench.protocol.depth_evidence import OBSTACLE_WIDTH_M
from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.robots.contract import DrivingView
from vsnbench.runner.episode.depth_guard import GuardReading, look_ahead
from vsnbench.runner.episode.local_map import LocalMap
from vsnbench.values.observation import observation_of
from vsnbench.values.pose import Pose, advanced
from vsnbench.values.robot_profile import RobotProfile

MAX_AGE_S = 0.6
"""An image captured longer ago does not show what is ahead of the robot now."""
REACTION_S = 0.15
"""Time from an image to zero velocity at the wheels: half a camera period at 10 Hz, a check, a message."""
_WAY_STEP_M = 0.03
"""Distance between the checked poses of a way."""
_STEP_M = 0.05
"""The guarded distance is rounded up to this, because the pixels of each distance are computed once."""


class PathGuard:
    """Checks the way ahead while a robot drives; the robot calls it as its `Watch`.

    The robot must be able to stop, from its present speed and before the next image, with as much distance to the
    obstacle as a discrete move leaves: the guard's distance less the length of a move.

    With a local map, the shell must also pass the obstacles that have left the view, until the robot can have stopped.

    Args:
        profile: profile of the robot.
        parameters: the protocol.
        local_map: what earlier images have shown; None checks the newest image only.
    """

    def __init__(
        self, profile: RobotProfile, parameters: ProtocolParameters, local_map: LocalMap | None = None
    ) -> None:
        self._map = local_map
        self._base = profile.base
        self._guard = parameters.depth_guard
        self._margin_m = max(parameters.depth_guard.distance_m - parameters.forward_m, 0.05)
        settings = MotionSettings.for_robot(profile, parameters)
        self._deceleration = settings.linear_m_s**2 / (2 * settings.deceleration_share * settings.forward_m)
        self.last: GuardReading | None = None
        """Reading that ended the movement, or the last one."""

    def __call__(self, view: DrivingView) -> str:
        """Return why the robot must stop, or an empty string."""
        if not self._guard.enabled:
            return ""
        if self._map is not None:
            self._map.add(view.depth_m, view.camera, view.pose, view.stamp_s)
        if view.linear_m_s < 0 or view.turns_on_the_spot:
            return ""
        if view.age_s > MAX_AGE_S:
            self.last = GuardReading()
            return f"the newest depth image was captured {view.age_s:.1f} s ago"
        self.last = look_ahead(
            observation_of(0.0, view.camera, depth_m=view.depth_m), self._base, self._guard_for(view)
        )
        if not self.last.blocked and self._map is not None and view.linear_m_s > 0:
            beside = self._beside(self._map, view)
            self.last = beside if beside.blocked else self.last
        return self.last.text if self.last.blocked else ""

    def _beside(self, local_map: LocalMap, view: DrivingView) -> GuardReading:
        """Return whether the robot meets what the local map has beside it, or turns to where no image has looked.

        A straight way is checked for known obstacles only: beside a narrow view there always is something unseen. Only
        what a turn adds to the straight way must have been seen, for the guard's distance: where the robot stops early,
        its next turn on the spot shows the corner.
        """
        stopping_m = min(self._stopping_m(view), view.remaining_m)
        ahead_m = min(max(self._stopping_m(view) + self._margin_m, self._guard.distance_m), view.remaining_m)
        curvature = view.angular_rad_s / view.linear_m_s
        radius_m, within_m = self._base.radius_m, self._base.radius_m + self._guard.margin_m
        cells = local_map.around(view.pose, within_m + ahead_m)
        side = "left" if curvature > 0 else "right"
        obstacles = cells.approached(_arc(stopping_m, curvature), within_m)
        if obstacles.any():
            return cells.met(obstacles, radius_m, side)
        turned = cells.distance_m(_arc(ahead_m, curvature)) <= radius_m
        added = turned & (cells.distance_m(_arc(ahead_m, 0.0)) > radius_m)
        return cells.unseen(added, OBSTACLE_WIDTH_M, side)

    def _stopping_m(self, view: DrivingView) -> float:
        """Return the way from the capture of an image until the robot can have stopped."""
        speed_m_s = abs(view.linear_m_s)
        return speed_m_s * (view.age_s + REACTION_S) + speed_m_s**2 / (2 * self._deceleration)

    def _guard_for(self, view: DrivingView) -> DepthGuard:
        """Return the guard with the distance and the width that this speed and this turn need."""
        speed_m_s = abs(view.linear_m_s)
        needed_m = min(self._stopping_m(view), view.remaining_m) + self._margin_m
        if speed_m_s == 0.0:  # before a leg: as for a discrete move, or less for a shorter leg
            needed_m = min(self._guard.distance_m, view.remaining_m + self._margin_m)
        distance_m = math.ceil(needed_m / _STEP_M - 1e-6) * _STEP_M
        curvature = abs(view.angular_rad_s) / speed_m_s if speed_m_s > 0.05 else 0.0
        aside_m = min(curvature * distance_m**2 / 2, 0.2)
        margin_m = self._guard.margin_m + math.ceil(aside_m / _STEP_M - 1e-6) * _STEP_M
        return self._guard.model_copy(update={"distance_m": distance_m, "margin_m": margin_m})


def _arc(length_m: float, curvature: float) -> list[Pose]:
    """Return poses along an arc from the robot on."""
    count = max(math.ceil(length_m / _WAY_STEP_M), 1)
    step_m = length_m / count
    poses = [Pose(0.0, 0.0)]
    for _ in range(count):
        poses.append(advanced(poses[-1], step_m, curvature * step_m))
    return poses
