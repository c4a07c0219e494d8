"""Checks of the odometry of a base at rest."""

import threading
import time
from collections.abc import Iterable, Iterator

from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import noise_of, noise_words, too_noisy
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.ros_common.interface import OdometryFrames
from vsnbench.sensing.odometry.odometry import OdometryTracker, PlanarReading
from vsnbench.sensing.odometry.transform_chain import TF_ADVICE
from vsnbench.sensing.topic_monitor import SETTLING_S, TopicMessages
from vsnbench.values.action import Action
from vsnbench.values.robot_profile import RobotProfile


class TfReadings:
    """Odometry from TF during a check-up; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._messages = TopicMessages()
        self._readings: list[PlanarReading] = []

    def take(self, pose: tuple[float, float, float], stamp_s: float, sender: str) -> None:
        """Take one pose: metres and radians."""
        with self._lock:
            self._messages.arrivals.append(time.time())
            self._messages.stamps.append(stamp_s)
            self._messages.senders |= {sender} - {""}
            self._readings.append(PlanarReading(*pose, stamp_s))

    @property
    def messages(self) -> TopicMessages:
        """Arrivals, stamps and senders of the poses."""
        with self._lock:
            messages = self._messages
            return TopicMessages(list(messages.arrivals), list(messages.stamps), [], set(messages.senders))

    @property
    def readings(self) -> list[PlanarReading]:
        """The poses, oldest first."""
        with self._lock:
            return list(self._readings)

    def settled_heading_rad(self) -> float | None:
        """Return the newest heading after a motion has settled; None if there is none."""
        time.sleep(SETTLING_S)
        readings = self.readings
        return readings[-1].heading_rad if readings else None


def frames_result(frames: OdometryFrames, fault: str, senders: set[str]) -> CheckResult:
    """Return whether the frames of a profile give odometry, from a single node."""
    name = f"{frames.odom_frame} to {frames.base_frame}"
    if len(senders) > 1:
        return CheckResult(name, Health.FAILED, f"{' and '.join(sorted(senders))} both publish it", "end one of them")
    if fault:
        return CheckResult(name, Health.FAILED, fault, TF_ADVICE)
    return CheckResult(name, Health.OK, "TF connects them")


def odometry_results(profile: RobotProfile, readings: Iterable[PlanarReading]) -> Iterator[CheckResult]:
    """Report whether the odometry is usable: finite values, no jumps, noise within the tolerances."""
    tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
    poses = []
    for reading in readings:
        fault = tracker.add(reading.x_m, reading.y_m, reading.heading_rad, reading.stamp_s, reading.stamp_s)
        if fault is not None:
            yield CheckResult("odometry", Health.FAILED, fault.text, "restart the driver of the base")
            return
        if tracker.latest is not None:
            poses.append(tracker.latest.pose)
    if not poses:
        return
    noise, settings = noise_of(poses), MotionSettings.for_robot(profile)
    for action in (Action.MOVE_FORWARD, Action.TURN_LEFT):
        of_action, tolerance = noise.along(turns=action.turns), settings.tolerance(action)
        if too_noisy(of_action, tolerance, settings.aim_share, profile.base.odometry_rate_hz):
            advice = "use filtered odometry, or set `tolerances` in the profile, which makes another campaign"
            yield CheckResult("odometry", Health.FAILED, noise_words(of_action, tolerance, turns=action.turns), advice)
            return
    seen = f"noise at rest {noise.position_m * 1000:.2g} mm, {noise.heading_deg:.2g}°"
    yield CheckResult("odometry", Health.OK, seen)
