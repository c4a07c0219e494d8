"""Checks of the odometry of a base at rest."""

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import (
    BOUND_ERRORS,
    STILL_SHARE,
    StandstillNoise,
    noise_of,
    noise_words,
    too_noisy,
)
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.ros.common.interface import OdometryFrames, RosInterface
from vsnbench.ros.common.odometry import attitude_of_imu
from vsnbench.sensing.odometry.attitude import AttitudeReader
from vsnbench.sensing.odometry.odometry import OdometryReading, OdometryTracker, PlanarReading
from vsnbench.sensing.odometry.transform_chain import TF_ADVICE
from vsnbench.sensing.topic_monitor import SETTLING_S, TopicMessages
from vsnbench.values.pose import LEVEL, Attitude, Pose
from vsnbench.values.robot_profile import RobotProfile, Tolerances

_NOISE_MARGIN = 1.15
"""Allowance for another measurement of the noise in a recommended tolerance."""
_MANTISSAS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
_LARGEST_M, _LARGEST_DEG = 0.1, 10.0
"""Largest tolerances of a profile."""


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

    def latest(self, count: int) -> list[OdometryReading]:
        """Return the last poses with their arrivals, oldest first."""
        with self._lock:
            readings = self._readings[-count:]
            arrivals = self._messages.arrivals[len(self._messages.arrivals) - len(readings) :]
        return [
            OdometryReading(Pose(reading.x_m, reading.y_m, reading.heading_rad), reading.stamp_s, arrival_s)
            for reading, arrival_s in zip(readings, arrivals, strict=True)
        ]

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
    accepted = []
    for reading in readings:
        fault = tracker.add(reading.x_m, reading.y_m, reading.heading_rad, reading.stamp_s, reading.stamp_s)
        if fault is not None:
            yield CheckResult("odometry", Health.FAILED, fault.text, "restart the driver of the base")
            return
        if tracker.latest is not None:
            accepted.append(tracker.latest)
    if not accepted:
        return
    noise, settings = noise_of([reading.pose for reading in accepted]), MotionSettings.for_robot(profile)
    faults = [
        noise_words(noise.along(turns=turns), settings.tolerance(turns=turns), turns=turns)
        for turns in (False, True)
        if _is_too_noisy(noise, settings.tolerance(turns=turns), profile, turns=turns)
    ]
    if faults:
        yield CheckResult("odometry", Health.FAILED, "; ".join(faults), tolerance_advice(profile, noise))
        return
    if (drift := drift_text(accepted, settings)) is not None:
        advice = "calibrate the gyro with the base at rest, check that nothing moves it, or use filtered odometry"
        yield CheckResult("odometry", Health.FAILED, drift, advice)
        return
    seen = f"noise at rest {noise.position_m * 1000:.2g} mm, {noise.heading_deg:.2g}°"
    yield CheckResult("odometry", Health.OK, seen)


def attitudes_in(names: RosInterface, messages: Iterable[Any], seconds: Callable[[Any], float]) -> list[Attitude | str]:
    """Return the attitudes in messages of their source, or why a message has none.

    Args:
        names: interface of the robot, with the source.
        messages: sensor_msgs/Imu if the source is an IMU, else nav_msgs/Odometry.
        seconds: returns a stamp in seconds.
    """
    if names.attitude is None:
        return []
    reader = AttitudeReader(names.attitude.topic, names.attitude.frame)
    if names.imu:
        return [attitude_of_imu(reader, message, seconds(message.header.stamp)) for message in messages]
    turns = [message.pose.pose.orientation for message in messages]
    return [reader.read((turn.x, turn.y, turn.z, turn.w)) for turn in turns]


def attitude_results(measured: Sequence[Attitude | str]) -> Iterator[CheckResult]:
    """Report the attitude of the base at rest, or why the last message has none."""
    if not measured:
        return
    if isinstance(last := measured[-1], str):
        yield CheckResult("attitude", Health.FAILED, last)
        return
    known = [attitude for attitude in measured if isinstance(attitude, Attitude)]
    spans = []
    for name, angles in (
        ("roll", [attitude.roll_rad for attitude in known]),
        ("pitch", [attitude.pitch_rad for attitude in known]),
    ):
        spans.append(f"{name} {math.degrees(min(angles)):.1f}° to {math.degrees(max(angles)):.1f}°")
    yield CheckResult("attitude", Health.OK, ", ".join(spans))


def last_attitude(measured: Sequence[Attitude | str]) -> Attitude:
    """Return the last attitude; level if there is none."""
    return next((attitude for attitude in reversed(measured) if isinstance(attitude, Attitude)), LEVEL)


def _is_too_noisy(noise: StandstillNoise, tolerance: float, profile: RobotProfile, *, turns: bool) -> bool:
    share = MotionSettings.for_robot(profile).aim_share
    return too_noisy(noise.along(turns=turns), tolerance, share, profile.base.odometry_rate_hz)


def tolerance_advice(profile: RobotProfile, noise: StandstillNoise) -> str:
    """Return the advice for noise that is too large for the tolerances: the tolerances that it allows."""
    settings = MotionSettings.for_robot(profile)
    worst = StandstillNoise(_NOISE_MARGIN * noise.position_m, _NOISE_MARGIN * noise.heading_rad)

    def position_holds(position_m: float) -> bool:
        return not _is_too_noisy(worst, position_m, profile, turns=False)

    def turn_holds(turn_deg: float) -> bool:
        return not _is_too_noisy(worst, math.radians(turn_deg), profile, turns=True)

    position_m: float | None = settings.position_tolerance_m
    turn_deg: float | None = math.degrees(settings.heading_tolerance_rad)
    if not position_holds(settings.position_tolerance_m):
        position_m = smallest_allowed(position_holds, _LARGEST_M)
    if not turn_holds(math.degrees(settings.heading_tolerance_rad)):
        turn_deg = smallest_allowed(turn_holds, _LARGEST_DEG)
    return f"use filtered odometry, or {tolerances_line(position_m, turn_deg)}"


def tolerances_line(position_m: float | None, turn_deg: float | None) -> str:
    """Return the tolerances to put into the profile; None for one that no value meets."""
    if position_m is None or turn_deg is None:
        return "another base: no tolerances of a profile can be met"
    allowed = Tolerances(position_m=round(position_m, 6), turn_deg=round(turn_deg, 6))
    lines = f"tolerances: {{position_m: {allowed.position_m:g}, turn_deg: {allowed.turn_deg:g}}}"
    return f"put into the profile, which makes another campaign: {lines}"


def smallest_allowed(holds: Callable[[float], bool], largest: float) -> float | None:
    """Return the smallest round value up to `largest` for which `holds` is true; None if there is none."""
    values = (mantissa * 10.0**exponent for exponent in range(-4, 2) for mantissa in _MANTISSAS)
    return next((value for value in values if value <= largest and holds(value)), None)


def drift_text(readings: Sequence[OdometryReading], settings: MotionSettings) -> str | None:
    """Return that the odometry at rest drifts too much for a base to count as settled; None if it does not."""
    times_s = [reading.stamp_s for reading in readings]
    for scale, unit, tolerance, values in (
        (1000.0, "mm", settings.position_tolerance_m, [reading.pose.x_m for reading in readings]),
        (1000.0, "mm", settings.position_tolerance_m, [reading.pose.y_m for reading in readings]),
        (math.degrees(1), "°", settings.heading_tolerance_rad, [reading.pose.heading_rad for reading in readings]),
    ):
        per_s, error = _slope(times_s, values)
        if (abs(per_s) - BOUND_ERRORS * error) * settings.settle_s > STILL_SHARE * tolerance:
            return (
                f"at rest the odometry drifts by {abs(per_s) * scale:.2g} {unit}/s: the base does not count as settled "
                f"within {settings.settle_s:.2g} s, and no movement can end"
            )
    return None


def _slope(times_s: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Return the slope of values over time and its standard error; zero for too few readings."""
    count = len(values)
    if count < 10 or times_s[-1] <= times_s[0]:
        return 0.0, 0.0
    middle_s, mean = sum(times_s) / count, sum(values) / count
    squares = sum((at_s - middle_s) ** 2 for at_s in times_s)
    slope = sum((at_s - middle_s) * (value - mean) for at_s, value in zip(times_s, values, strict=True)) / squares
    rest = sum((v - mean - slope * (t - middle_s)) ** 2 for t, v in zip(times_s, values, strict=True))
    return slope, math.sqrt(rest / (count - 2) / squares)
