"""The stop of a base is measured by its odometry, and a measurement is stored per robot."""

import math
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from vsnbench.control.command import Command
from vsnbench.errors import RobotError
from vsnbench.robots.checkup.ros2 import stored_watchdog_result
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros import watchdog
from vsnbench.robots.ros.watchdog import (
    WatchdogMeasurement,
    require_watchdog,
    stopped_after_s,
    store_measurement,
    stored_measurement,
)
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.values.pose import Pose, wrap_angle

PROFILE = load_profile("turtlebot4")


def turning_until(stop_s: float | None, rate_hz: float) -> list[OdometryReading]:
    """Readings of a base that turns at 0.3 rad/s and gets its last command at 0 s."""
    times_s = [i / rate_hz for i in range(int(-0.5 * rate_hz), int(1.5 * rate_hz))]
    turned_s = [at_s if stop_s is None else min(at_s, stop_s) for at_s in times_s]
    return [
        OdometryReading(Pose(0.0, 0.0, 0.3 * turned), at_s, at_s)
        for at_s, turned in zip(times_s, turned_s, strict=True)
    ]


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize("stop_s", [0.1, 0.5, 0.9])
def test_the_stop_is_timed_by_the_odometry(rate_hz: float, stop_s: float) -> None:
    measured_s = stopped_after_s(turning_until(stop_s, rate_hz), 0.0)
    assert measured_s is not None
    assert abs(measured_s - stop_s) < 1.5 / rate_hz


def test_a_base_that_still_moves_has_not_stopped() -> None:
    assert stopped_after_s(turning_until(None, 50), 0.0) is None
    assert stopped_after_s([], 0.0) is None


class LaggingBase:
    """A link to a base with dead time and a first-order lag, whose watchdog acts `timeout_s` after the last command.

    Its clock is virtual. It stands with its heading at half a turn, where the angle of its odometry wraps.
    """

    STEP_S = 0.02

    def __init__(self, *, dead_s: float, lag_s: float, timeout_s: float | None, obeys_zero: bool = True) -> None:
        self._dead_s, self._lag_s, self._timeout_s, self._obeys_zero = dead_s, lag_s, timeout_s, obeys_zero
        self._heading_rad, self._rad_s, self._wanted_rad_s = math.pi - 0.01, 0.0, 0.0
        self._commanded_s = math.inf
        self._commands: list[tuple[float, float]] = []
        self._readings: list[OdometryReading] = []
        self._holds = False
        self.at_s = 0.0
        self.sleep(0.1)

    def monotonic(self) -> float:
        return self.at_s

    def sleep(self, duration_s: float) -> None:
        for _ in range(round(duration_s / self.STEP_S)):
            self.at_s += self.STEP_S
            if self._holds:
                self.steer(Command())
            while self._commands and self._commands[0][0] + self._dead_s <= self.at_s + 1e-9:
                self._commanded_s, self._wanted_rad_s = self._commands.pop(0)
            silent = self._timeout_s is not None and self.at_s > self._last_s() + self._dead_s + self._timeout_s
            wanted = 0.0 if silent else self._wanted_rad_s
            self._rad_s += (wanted - self._rad_s) * min(1.0, self.STEP_S / self._lag_s)
            self._heading_rad += self._rad_s * self.STEP_S
            self._readings.append(OdometryReading(Pose(0, 0, wrap_angle(self._heading_rad)), self.at_s, self.at_s))

    def _last_s(self) -> float:
        return self._commands[-1][0] if self._commands else self._commanded_s

    def steer(self, command: Command) -> None:
        if command.angular_rad_s or self._obeys_zero:
            self._commands.append((self.at_s, command.angular_rad_s))

    def hold_still(self) -> None:
        self._holds = True

    def release(self) -> None:
        self._holds = False

    def snapshot(self) -> SimpleNamespace:
        return SimpleNamespace(
            readings=self._readings, latest=self._readings[-1], hazard_events=(), at_rest=lambda *_: False
        )

    def wait_for(self, condition: Callable[[Any], Any], timeout_s: float) -> Any:
        give_up_s = self.at_s + timeout_s
        while not (met := condition(self.snapshot())) and self.at_s < give_up_s:
            self.sleep(self.STEP_S)
        return met


def measurement_of(base: LaggingBase, monkeypatch: pytest.MonkeyPatch) -> WatchdogMeasurement:
    monkeypatch.setattr(watchdog, "time", base)
    return watchdog.measure_watchdog(cast("RobotLink", base), PROFILE)


@pytest.mark.parametrize(("dead_s", "lag_s"), [(0.0, 0.02), (0.1, 0.1), (0.15, 0.2), (0.2, 0.3)])
def test_dead_time_and_braking_of_the_base_are_allowed(
    dead_s: float, lag_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated_s = PROFILE.interface.command_timeout_s
    for timeout_s in (stated_s, stated_s / 2):
        kept = measurement_of(LaggingBase(dead_s=dead_s, lag_s=lag_s, timeout_s=timeout_s), monkeypatch)
        assert kept.passed, kept.seen
    for timeout_s in (stated_s + 1.0, None):
        base = LaggingBase(dead_s=dead_s, lag_s=lag_s, timeout_s=timeout_s)
        late = measurement_of(base, monkeypatch)
        assert not late.passed, late.seen
        assert late.seen.startswith("the base still moved")


def test_a_base_that_does_not_obey_zero_velocity_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    base = LaggingBase(dead_s=0.0, lag_s=0.02, timeout_s=None, obeys_zero=False)
    with pytest.raises(RobotError) as refused:
        measurement_of(base, monkeypatch)
    assert refused.value.code == "base-does-not-stop"


def measured(stopped_s: float | None) -> WatchdogMeasurement:
    return WatchdogMeasurement(
        robot="turtlebot4", stated_s=0.5, allowed_s=0.9, stopped_s=stopped_s, measured_at=datetime.now(UTC)
    )


@pytest.mark.parametrize(("stopped_s", "health"), [(0.55, "ok"), (1.2, "failed"), (None, "failed")])
def test_the_last_measurement_counts(stopped_s, health, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert stored_watchdog_result(PROFILE, simulated=False).health == "warning"
    store_measurement(measured(0.5), PROFILE, simulated=False)
    store_measurement(measured(stopped_s), PROFILE, simulated=False)
    assert stored_watchdog_result(PROFILE, simulated=False).health == health


def test_a_simulated_base_another_timeout_and_a_broken_file_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    store_measurement(measured(0.5), PROFILE, simulated=True)
    assert stored_measurement(PROFILE, simulated=False) is None
    slower = PROFILE.model_copy(update={"interface": PROFILE.interface.model_copy(update={"command_timeout_s": 0.8})})
    assert stored_measurement(slower, simulated=True) is None
    (file,) = (tmp_path / "vsnbench" / "watchdogs").iterdir()
    file.write_text("{")
    assert stored_measurement(PROFILE, simulated=True) is None


def link(*, steers: bool = True, rehearsal: bool | None = None) -> SimpleNamespace:
    """A connection to a robot, simulated if `rehearsal` is set."""
    account = None if rehearsal is None else SimpleNamespace(is_rehearsal=rehearsal)
    return SimpleNamespace(
        steer=(lambda _: None) if steers else None, snapshot=lambda: SimpleNamespace(simulation=account)
    )


@pytest.mark.parametrize("rehearsal", [None, True])
def test_a_base_is_steered_only_after_a_passed_measurement(
    rehearsal: bool | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    require_watchdog(link(steers=False, rehearsal=rehearsal), PROFILE)  # the node next to the base stops it
    with pytest.raises(RobotError) as refused:
        require_watchdog(link(rehearsal=rehearsal), PROFILE)
    assert refused.value.code == "watchdog-not-measured"
    for stopped_s in (1.2, None):
        store_measurement(measured(stopped_s), PROFILE, simulated=rehearsal is not None)
        with pytest.raises(RobotError) as refused:
            require_watchdog(link(rehearsal=rehearsal), PROFILE)
        assert refused.value.code == "watchdog-failed"
    store_measurement(measured(0.5), PROFILE, simulated=rehearsal is not None)
    require_watchdog(link(rehearsal=rehearsal), PROFILE)
