"""The watchdog of a base that this process steers: whether the base stops when commands stop.

`vsnbench doctor --move` measures it and stores the result on this machine. A session steers such a base only after a
passed measurement, because a killed process sends no zero velocity.
"""

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.control.command import Command
from vsnbench.errors import RobotError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.home import expanded
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.pose import wrap_angle
from vsnbench.values.robot_profile import RobotProfile

_TURN_RAD_S = 0.3
"""Velocity of the turn on the spot, in which the base cannot hit anything."""
_TURNED_RAD = math.radians(3)
_STARTING_S = 2.0
_PERIOD_S = 0.02
_REST_S = 0.2
_REST_SHARE = 0.1
"""A base at rest turns slower than this share of the commanded velocity."""
_ALLOWED_S = 0.3
"""Least allowance for the transport of command and odometry, and for braking."""
_LONGEST_S = 1.0
"""Longest timeout of a base that may be steered over a network."""
_STANDSTILL_S = 2.0


class WatchdogMeasurement(BaseModel):
    """Behaviour of a base after the commands stopped."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    robot: str
    stated_s: float = Field(gt=0, description="command_timeout_s of the profile")
    allowed_s: float = Field(gt=0, description="longest time of a passed measurement")
    stopped_s: float | None = Field(description="time from the last command to rest, by odometry; none for no stop")
    measured_at: datetime

    @property
    def passed(self) -> bool:
        """Whether the base stopped in time."""
        return self.stopped_s is not None and self.stopped_s <= self.allowed_s

    @property
    def seen(self) -> str:
        """The measurement in one line."""
        stated = f"the profile states command_timeout_s: {self.stated_s:g}"
        if self.stopped_s is None:
            return f"the base still moved {self.allowed_s:.2f} s after the last command and was stopped; {stated}"
        return f"the base stopped {self.stopped_s:.2f} s after the last command; {stated}"


def measure_watchdog(link: RobotLink, profile: RobotProfile) -> WatchdogMeasurement:
    """Turn the base slowly, stop sending commands, and measure by the odometry when the base stops.

    Before, the base turns the other way and is told to stop. What it takes for that, its dead time and its braking, is
    allowed to the watchdog too. The base turns by about 30 degrees at most, and is at rest afterwards.

    Raises:
        RobotError: another process steers, the profile states a too long timeout, or the base does not turn or stop.
    """
    steer, stated_s = link.steer, float(interface_of(profile).command_timeout_s)
    if steer is None:
        raise RobotError(
            "this process does not steer the base",
            advice="measure the watchdog without discrete_move on the robot",
            code="not-steering",
        )
    if stated_s > _LONGEST_S:
        raise RobotError(
            f"the profile states command_timeout_s: {stated_s:g}; a base that is steered over a network must stop "
            f"within {_LONGEST_S:g} s",
            advice=f"start on the robot: vsnbench robots serve {profile.argument}",
            code="watchdog-too-slow",
        )
    turn_rad_s = max(_TURN_RAD_S, profile.base.min_angular_rad_s)
    try:
        told_s = _turn(link, steer, -turn_rad_s)
        link.hold_still()
        braked_s = _stop_after(link, told_s, _LONGEST_S)
        link.release()
        if braked_s is None:
            raise RobotError(
                f"the base still moves {_LONGEST_S:g} s after a command of zero velocity",
                advice="check that no other program steers it, and that its odometry is at rest when it stands",
                code="base-does-not-stop",
            )
        allowed_s = stated_s + max(_ALLOWED_S, braked_s) + 2 / profile.base.odometry_rate_hz
        silent_s = _turn(link, steer, turn_rad_s)
        stopped_s = _stop_after(link, silent_s, allowed_s)
    finally:
        link.hold_still()
        link.wait_for(lambda now: now.at_rest(_REST_S, 0.001, _REST_SHARE * _TURN_RAD_S * _REST_S), _STANDSTILL_S)
        link.release()
    return WatchdogMeasurement(
        robot=profile.name,
        stated_s=stated_s,
        allowed_s=allowed_s,
        stopped_s=stopped_s,
        measured_at=datetime.now(UTC),
    )


def _stop_after(link: RobotLink, since_s: float, limit_s: float) -> float | None:
    """Wait until the base stands; return the time from `since_s`, or None where it turns after `limit_s`."""

    def over(now: RobotSnapshot) -> bool:
        if now.latest is None or now.hazard_events:
            return True
        return stopped_after_s(now.readings, since_s) is not None or now.latest.stamp_s - since_s > limit_s + _REST_S

    link.wait_for(over, 3 * (limit_s + _REST_S))
    now = link.snapshot()
    for hazard, where in now.hazard_events:
        raise RobotError(
            f"{hazard.value} ({where}) while the watchdog was measured", advice="free the robot first", code="hazard"
        )
    return stopped_after_s(now.readings, since_s)


def _turn(link: RobotLink, steer: Callable[[Command], None], velocity_rad_s: float) -> float:
    """Turn the base until the odometry shows the turn. Returns the newest stamp at the last command."""
    began_s, before = time.monotonic(), link.snapshot().latest
    while True:
        steer(Command(angular_rad_s=velocity_rad_s))
        time.sleep(_PERIOD_S)
        now = link.snapshot().latest
        if before is not None and now is not None:
            turned_rad = wrap_angle(now.pose.heading_rad - before.pose.heading_rad)
            if math.copysign(1, velocity_rad_s) * turned_rad > _TURNED_RAD:
                return now.stamp_s
        if time.monotonic() - began_s > _STARTING_S:
            raise RobotError(
                "the base does not turn on command",
                advice="check that it is off its dock and its motor is on",
                code="base-does-not-turn",
            )


def stopped_after_s(readings: Sequence[OdometryReading], silent_s: float) -> float | None:
    """Return the time from `silent_s`, on the robot's clock, to the rest of the base; None while it turns."""
    later = [reading for reading in readings if reading.stamp_s >= silent_s]
    for first in later:
        window = [reading for reading in later if 0 <= reading.stamp_s - first.stamp_s <= _REST_S + 1e-3]
        span_s = window[-1].stamp_s - first.stamp_s
        turned_rad = max(abs(wrap_angle(reading.pose.heading_rad - first.pose.heading_rad)) for reading in window)
        if len(window) > 2 and span_s > 0.6 * _REST_S and turned_rad < _REST_SHARE * _TURN_RAD_S * _REST_S:
            return first.stamp_s - silent_s
    return None


def require_watchdog(link: RobotLink, profile: RobotProfile) -> None:
    """Make sure that a base which this process steers stops when commands stop.

    A simulated base is measured here, unless it has passed before: a busy machine may delay it once. A rehearsal needs
    the measurement of `doctor`, like a real robot.

    Raises:
        RobotError: the watchdog was not measured on this machine, or the base did not stop.
    """
    if link.steer is None:
        return
    account = link.snapshot().simulation
    measured = stored_measurement(profile, simulated=account is not None)
    if account is not None and not account.is_rehearsal and not (measured and measured.passed):
        measured = measure_watchdog(link, profile)
        store_measurement(measured, profile, simulated=True)
    if measured is None:
        raise RobotError(
            f"the watchdog of {profile.title} was not measured on this machine",
            advice=watchdog_advice(profile),
            code="watchdog-not-measured",
        )
    if not measured.passed:
        raise RobotError(
            f"{measured.seen} (measured {measured.measured_at:%Y-%m-%d})",
            advice=watchdog_advice(profile),
            code="watchdog-failed",
        )


def store_measurement(measurement: WatchdogMeasurement, profile: RobotProfile, *, simulated: bool) -> None:
    """Store a measurement on this machine.

    Raises:
        RobotError: the file cannot be written.
    """
    write_atomic(_file(profile, simulated=simulated), measurement.model_dump_json(indent=1).encode(), RobotError)


def stored_measurement(profile: RobotProfile, *, simulated: bool) -> WatchdogMeasurement | None:
    """Return the stored measurement of a base, or None."""
    try:
        return WatchdogMeasurement.model_validate_json(_file(profile, simulated=simulated).read_bytes())
    except (OSError, ValidationError):
        return None


def _file(profile: RobotProfile, *, simulated: bool) -> Path:
    """Return the file of a measurement, by what it depends on, in $XDG_STATE_HOME or ~/.local/state."""
    names = interface_of(profile)
    depends = [profile.name, profile.base.model_dump(mode="json"), names.command, names.command_timeout_s, simulated]
    key = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()[:16]
    state = expanded(os.environ.get("XDG_STATE_HOME") or "~/.local/state")
    return state / "vsnbench" / "watchdogs" / f"{profile.name}-{key}.json"


def watchdog_advice(profile: RobotProfile) -> str:
    """Return the commands that measure the watchdog, or do without."""
    robot = profile.argument
    return f"run vsnbench doctor --robot {robot} --move; or on the robot: vsnbench robots serve {robot}"
