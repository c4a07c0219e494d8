"""The depth guard while a robot drives: how much free way it needs ahead, and whether it sees it."""

import math

from vsnbench.control.settings import MotionSettings
from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.robots.contract import DrivingView
from vsnbench.runner.episode.depth_guard import GuardReading, look_ahead
from vsnbench.values.observation import observation_of
from vsnbench.values.robot_profile import RobotProfile

MAX_AGE_S = 0.6
"""An image captured longer ago does not show what is ahead of the robot now."""
REACTION_S = 0.15
"""Time from an image to zero velocity at the wheels: half a camera period at 10 Hz, a check, a message."""
_STEP_M = 0.05
"""The guarded distance is rounded up to this, because the pixels of each distance are computed once."""


class PathGuard:
    """Checks the way ahead during one movement; a robot calls it as its `Watch`.

    The robot must be able to stop, from its present speed and before the next image, with as much distance to the
    obstacle as a discrete move leaves: the guard's distance less the length of a move.
    """

    def __init__(self, profile: RobotProfile, parameters: ProtocolParameters) -> None:
        self._base = profile.base
        self._guard = parameters.depth_guard
        self._margin_m = max(parameters.depth_guard.distance_m - parameters.forward_m, 0.05)
        settings = MotionSettings.for_robot(profile, parameters)
        self._deceleration = settings.linear_m_s**2 / (2 * settings.deceleration_share * settings.forward_m)
        self.last: GuardReading | None = None
        """Reading that ended the movement, or the last one."""

    def __call__(self, view: DrivingView) -> str:
        """Return why the robot must stop, or an empty string."""
        if not self._guard.enabled or view.linear_m_s < 0:
            return ""
        if view.age_s > MAX_AGE_S:
            self.last = GuardReading()
            return f"the newest depth image was captured {view.age_s:.1f} s ago"
        self.last = look_ahead(
            observation_of(0.0, view.camera, depth_m=view.depth_m), self._base, self._guard_for(view)
        )
        return self.last.text if self.last.blocked else ""

    def _guard_for(self, view: DrivingView) -> DepthGuard:
        """Return the guard with the distance and the width that this speed and this turn need."""
        speed_m_s = abs(view.linear_m_s)
        stopping_m = speed_m_s * (view.age_s + REACTION_S) + speed_m_s**2 / (2 * self._deceleration)
        needed_m = min(stopping_m, view.remaining_m) + self._margin_m
        if speed_m_s == 0.0:  # before a leg: as for a discrete move, or less for a shorter leg
            needed_m = min(self._guard.distance_m, view.remaining_m + self._margin_m)
        distance_m = math.ceil(needed_m / _STEP_M - 1e-6) * _STEP_M
        curvature = abs(view.angular_rad_s) / speed_m_s if speed_m_s > 0.05 else 0.0
        aside_m = min(curvature * distance_m**2 / 2, 0.2)
        margin_m = self._guard.margin_m + math.ceil(aside_m / _STEP_M - 1e-6) * _STEP_M
        return self._guard.model_copy(update={"distance_m": distance_m, "margin_m": margin_m})
