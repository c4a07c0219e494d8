"""What the network is told about where it is: Habitat's episodic GPS and compass, from odometry.

Habitat's GPS is (forward, RIGHT) in metres and its compass counter-clockwise in radians, both from the start of the
episode. This is the one place where the sign of y is turned.
"""

import math
from dataclasses import dataclass

from vsnbench.models.pirlnav.settings import CompassSource, PIRLNavSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.pose import Pose, wrap_angle


@dataclass(frozen=True, slots=True)
class Location:
    """One reading of both sensors; under `as_published` the second number is metres LEFT and the origin is not the
    episode's start.
    """

    gps_m: tuple[float, float]
    compass_rad: float


class Localiser:
    """Turns start-relative odometry into GPS and compass."""

    def __init__(self, settings: PIRLNavSettings) -> None:
        self._settings = settings
        self._origin = Pose(0.0, 0.0)
        """Start of the episode in the odometry frame that the published code never reset."""
        self._last = Pose(0.0, 0.0)
        self._turned_deg = 0.0

    def reset(self) -> None:
        """Begin an episode.

        The published code read the base's odometry as it was. It goes on where it stood when the last episode ended,
        because nobody counts the wheels' turns while the robot is carried to its next start.
        """
        self._origin = self._origin.compose(self._last)
        self._last = Pose(0.0, 0.0)
        self._turned_deg = 0.0

    def read(self, pose: Pose) -> Location:
        """Return what the sensors say at a pose relative to the episode's start."""
        self._last = pose
        if self._settings.as_published:
            pose = self._origin.compose(pose)
            gps = (pose.x_m, pose.y_m)
        else:
            gps = (pose.x_m, 0.0 - pose.y_m)  # a minus alone would make -0.0 of 0.0
        by_turns = self._settings.compass is CompassSource.TURNS
        return Location(gps, wrap_angle(math.radians(self._turned_deg) if by_turns else pose.heading_rad))

    def moved(self, action: Action) -> None:
        """Count a turning movement."""
        if action is Action.TURN_LEFT:
            self._turned_deg += self._settings.turn_deg
        elif action is Action.TURN_RIGHT:
            self._turned_deg -= self._settings.turn_deg
