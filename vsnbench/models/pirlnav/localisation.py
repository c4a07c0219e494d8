"""Habitat's episodic GPS and compass, from odometry.

Habitat's GPS is (forward, RIGHT) in metres and its compass counter-clockwise in radians, both relative to the start of
the episode. Only this module inverts the sign of y.
"""

import math

from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose, wrap_angle


class Localiser:
    """Converts odometry relative to the start to GPS and compass."""

    def __init__(self, settings: PIRLNavSettings) -> None:
        self._settings = settings
        self._origin = Pose(0.0, 0.0)
        """Start of the episode in the odometry frame, which the published code never reset."""
        self._last = Pose(0.0, 0.0)
        self._turned_deg = 0.0

    def reset(self) -> None:
        """Start an episode.

        The published code used the base's raw odometry, which continues from the end of the previous episode, because
        the wheels do not turn while the robot is carried to its next start.
        """
        self._origin = self._origin.compose(self._last)
        self._last = Pose(0.0, 0.0)
        self._turned_deg = 0.0

    def read(self, pose: Pose) -> tuple[tuple[float, float], float]:
        """Return GPS and compass at a pose relative to the start of the episode.

        With `as_published` the second number of the GPS is metres LEFT, and its origin is not the start of the episode.
        """
        self._last = pose
        if self._settings.as_published:
            pose = self._origin.compose(pose)
            gps = (pose.x_m, pose.y_m)
        else:
            gps = (pose.x_m, 0.0 - pose.y_m)  # unary minus would give -0.0 for 0.0
        by_turns = self._settings.compass == "turns"
        return gps, wrap_angle(math.radians(self._turned_deg) if by_turns else pose.heading_rad)

    def moved(self, action: Action) -> None:
        """Count a turning movement."""
        if action is Action.TURN_LEFT:
            self._turned_deg += self._settings.turn_deg
        elif action is Action.TURN_RIGHT:
            self._turned_deg -= self._settings.turn_deg
