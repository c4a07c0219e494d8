"""Checks of the depth images that arrive while a robot over ROS drives."""

import math
import time

from vsnbench.errors import ImageError
from vsnbench.robots.contract import DrivingView, PathCheck
from vsnbench.robots.ros.camera import RosCamera
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.images.intrinsics import CalibrationError
from vsnbench.sensing.movement_check import MovementAlarmError
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.pose import wrap_angle

_SPEED_PERIOD_S = 0.12
"""Time over which the speed is measured by the odometry."""
_DRIVING_M_S = 0.015
"""A slower robot stands, or turns on the spot, and needs no free way."""
_LONGEST_AGE_S = 0.3
"""No movement forward begins or goes on if the last depth image arrived longer ago."""


class PathLooks:
    """Passes each new depth image of one movement to a check."""

    def __init__(self, camera: RosCamera, check: PathCheck) -> None:
        self._camera = camera
        self._check = check
        self._last_arrival_s = -math.inf

    def require_sight(self, now: RobotSnapshot) -> None:
        """Make sure that depth images arrive, before a movement forward begins.

        Raises:
            MovementAlarmError: no depth image is new.
        """
        age_s = time.monotonic() - now.depths[-1].arrival_s if now.depths else math.inf
        if age_s > _LONGEST_AGE_S:
            since = f" for {age_s:.1f} s" if now.depths else ""
            raise MovementAlarmError(f"no depth image{since}", blocked=True)

    def look(self, now: RobotSnapshot, remaining_m: float) -> None:
        """Check the newest depth image if the robot drives forward.

        Without a new image, the age of the last one grows until the check refuses to drive on.

        Args:
            now: the newest reports.
            remaining_m: distance that the movement still has to cover.

        Raises:
            MovementAlarmError: the way ahead is not free, or not seen.
        """
        linear_m_s, angular_rad_s = velocity_of(now.readings)
        if linear_m_s < _DRIVING_M_S or not now.depths:
            return
        newest = now.depths[-1]
        age_s = time.monotonic() - newest.arrival_s
        if newest.arrival_s == self._last_arrival_s and age_s < _SPEED_PERIOD_S:
            return
        if age_s > _LONGEST_AGE_S:
            raise MovementAlarmError(f"no depth image for {age_s:.1f} s", blocked=True)
        self._last_arrival_s = newest.arrival_s
        try:
            depth_m = self._camera.depth_of(newest)
        except (ImageError, CalibrationError, ValueError) as error:
            raise MovementAlarmError(f"a depth image cannot be read: {error}", sensor_lost=True) from error
        camera = self._camera.model
        view = DrivingView(depth_m, camera, captured_ago_s(newest, now), linear_m_s, angular_rad_s, remaining_m)
        if reason := self._check(view):
            raise MovementAlarmError(reason, blocked=True)


def captured_ago_s(image: Stamped, now: RobotSnapshot) -> float:
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
