"""Reasons that end a movement over ROS at once."""

import time
from dataclasses import dataclass

from vsnbench.errors import SensorLostError
from vsnbench.ros.common.interface import RosInterface
from vsnbench.sensing.movement_check import MovementAlarmError, RequestedDrive, RequestedMovement
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sensing.steering import rival_text
from vsnbench.values.pose import Pose

ODOMETRY_TIMEOUT_S = 0.8


@dataclass(frozen=True, slots=True)
class MovementWatch:
    """Checks of one movement while it runs."""

    names: RosInterface
    requested: RequestedMovement | RequestedDrive
    origin: Pose
    """Odometry at the start of the episode."""
    before: Pose
    """Odometry at the request, relative to `origin`."""
    requested_s: float
    """Time of the request (monotonic clock)."""

    def check(self, now: RobotSnapshot, listening_since_s: float) -> None:
        """Check the newest reports.

        Args:
            now: the reports.
            listening_since_s: end of this process's last pause (monotonic clock); silence counts from then.

        Raises:
            MovementAlarmError: the movement has to end at once.
        """
        for hazard, where in now.hazard_events:
            raise MovementAlarmError(f"{hazard.value} ({where})")
        if now.contact:
            raise MovementAlarmError(f"touched {now.contact}")
        if now.rival_s > self.requested_s:
            raise MovementAlarmError(rival_text(now.rival, self.names.command))
        if now.odometry_fault:
            raise MovementAlarmError(now.odometry_fault.text, sensor_lost=True)
        now_s = time.monotonic()
        if (silent_s := min(now.odometry_age_s(now_s), now_s - listening_since_s)) > ODOMETRY_TIMEOUT_S:
            raise MovementAlarmError(str(no_odometry(self.names.odometry_topic, silent_s)), sensor_lost=True)
        pose = now.latest.pose.relative_to(self.origin) if now.latest else Pose(0.0, 0.0)
        if overshoot := self.requested.overshoot(self.before, pose):
            raise MovementAlarmError(f"{self.names.discrete_move} was stopped: {overshoot}")


def no_odometry(topic: str, silent_s: float) -> SensorLostError:
    """Return the error of silent odometry."""
    return SensorLostError(
        f"no odometry on {topic} for {silent_s:.1f} s", advice="check the driver of the base", code="no-odometry"
    )
