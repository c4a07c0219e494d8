"""Checks of the depth images that arrive while a robot over ROS drives."""

import math
import time
from typing import Any

from vsnbench.errors import ImageError, SensorLostError
from vsnbench.robots.contract import DrivingView, Watch
from vsnbench.robots.ros.camera import RosCamera
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.images.intrinsics import CalibrationError
from vsnbench.sensing.movement_check import MovementAlarmError
from vsnbench.sensing.odometry.odometry import OdometryReading, pose_at
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.pose import Pose, wrap_angle

_SPEED_PERIOD_S = 0.12
"""Time over which the speed is measured by the odometry."""
_DRIVING_M_S = 0.015
"""A slower robot stands, or turns on the spot, and needs no free way."""
_TURNING_RAD_S = 0.05
"""A robot that turns on the spot more slowly stands: it sees nothing new."""
_LONGEST_AGE_S = 0.3
"""No movement forward goes on if the last depth image arrived longer ago."""
_LONGEST_DELAY_S = 0.5
"""No movement forward begins if the last depth image was captured longer ago, as over a slow network."""
_SIGHT_TIMEOUT_S = 1.0
"""Longest wait for such an image before a movement."""


class PathLooks:
    """Passes each new depth image of one movement to a check.

    Args:
        camera: decodes the images.
        check: the check.
        origin: odometry at the start of the episode.
    """

    def __init__(self, camera: RosCamera, check: Watch, origin: Pose) -> None:
        self._camera = camera
        self._origin = origin
        self.check = check
        self._last_arrival_s = -math.inf

    def require_sight(self, link: RobotLink) -> None:
        """Wait for a depth image that was captured just now, before a movement forward begins.

        Raises:
            MovementAlarmError: no depth image is new.
        """
        self.load(link.snapshot())
        if not link.wait_for(_sees_now, _SIGHT_TIMEOUT_S):
            now = link.snapshot()
            since = f" captured in the last {captured_ago_s(now.depths[-1], now):.1f} s" if now.depths else ""
            raise MovementAlarmError(f"no depth image{since}", blocked=True)

    def load(self, now: RobotSnapshot) -> None:
        """Run the check once while the robot is at rest: loading its compiled code takes longer than a look may take.

        Raises:
            MovementAlarmError: the newest depth image cannot be read.
        """
        if now.depths:
            self.check(self._view(now, 0.0, (0.0, 0.0), math.inf))

    def look_from_rest(self, now: RobotSnapshot, since_s: float, remaining_m: float) -> bool:
        """Check an image of a robot at rest that is to leave its position; return whether there is one already.

        Args:
            now: the newest reports.
            since_s: the image is captured after this time on the robot's clock.
            remaining_m: distance that the robot still has to cover.

        Raises:
            MovementAlarmError: the way ahead is not free.
        """
        if not now.depths or now.depths[-1].stamp_s < since_s:
            return False
        age_s = captured_ago_s(now.depths[-1], now)
        if reason := self.check(self._view(now, age_s, (0.0, 0.0), remaining_m)):
            raise MovementAlarmError(reason, blocked=True)
        return True

    def look(self, now: RobotSnapshot, remaining_m: float) -> None:
        """Check the newest depth image if the robot drives forward, or show it to the check if it turns on the spot.

        Without a new image, the age of the last one grows until the check refuses to drive on.

        Args:
            now: the newest reports.
            remaining_m: distance that the movement still has to cover.

        Raises:
            MovementAlarmError: the way ahead is not free, or not seen.
        """
        linear_m_s, angular_rad_s = velocity_of(now.readings)
        turns = abs(linear_m_s) < _DRIVING_M_S and abs(angular_rad_s) > _TURNING_RAD_S
        if (linear_m_s < _DRIVING_M_S and not turns) or not now.depths:
            return
        newest = now.depths[-1]
        age_s = time.monotonic() - newest.arrival_s
        if newest.arrival_s == self._last_arrival_s and age_s < _SPEED_PERIOD_S:
            return
        if age_s > _LONGEST_AGE_S:
            if turns:
                return
            raise MovementAlarmError(f"no depth image for {age_s:.1f} s", blocked=True)
        self._last_arrival_s = newest.arrival_s
        velocity = (0.0 if turns else linear_m_s, angular_rad_s)
        if reason := self.check(self._view(now, captured_ago_s(newest, now), velocity, remaining_m)):
            raise MovementAlarmError(reason, blocked=True)

    def _view(self, now: RobotSnapshot, age_s: float, velocity: tuple[float, float], remaining_m: float) -> DrivingView:
        """Return the newest depth image with the odometry at its capture."""
        image = now.depths[-1]
        here = pose_at(now.readings, image.stamp_s) or (self._origin if now.latest is None else now.latest.pose)
        try:
            depth_m, camera = self._camera.depth_of(image)
            return DrivingView(
                depth_m, camera, here.relative_to(self._origin), image.stamp_s, age_s, *velocity, remaining_m
            )
        except SensorLostError as error:
            raise MovementAlarmError(str(error), sensor_lost=True) from error
        except (ImageError, CalibrationError, ValueError) as error:
            raise MovementAlarmError(f"a depth image cannot be read: {error}", sensor_lost=True) from error


def _sees_now(now: RobotSnapshot) -> bool:
    return bool(now.depths) and captured_ago_s(now.depths[-1], now) <= _LONGEST_DELAY_S


def captured_ago_s(image: Stamped[Any], now: RobotSnapshot) -> float:
    """Return the time since the capture of an image, by the stamps of image and odometry, which share a clock.

    A busy camera or network delivers an image late: the robot is then nearer to what the image shows.
    """
    since_arrival_s = time.monotonic() - image.arrival_s
    if now.latest is None:
        return since_arrival_s
    since_odometry_s = time.monotonic() - now.latest.arrival_s
    return max(since_arrival_s, now.latest.stamp_s - image.stamp_s + since_odometry_s)


def velocity_of(readings: tuple[OdometryReading, ...]) -> tuple[float, float]:
    """Return forward and angular velocity by the newest odometry; 0 without enough readings."""
    if len(readings) < 2:
        return 0.0, 0.0
    last = readings[-1]
    first = next(
        (reading for reading in reversed(readings[:-1]) if last.stamp_s - reading.stamp_s >= _SPEED_PERIOD_S),
        readings[0],
    )
    passed_s = last.stamp_s - first.stamp_s
    if passed_s <= 0:
        return 0.0, 0.0
    motion = last.pose.relative_to(first.pose)
    distance_m = math.hypot(motion.x_m, motion.y_m)
    forward = distance_m if motion.x_m >= 0 else -distance_m
    return forward / passed_s, wrap_angle(motion.heading_rad) / passed_s
