"""The stop of a base is measured by its odometry, and a measurement is stored per robot."""

from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from vsnbench.errors import RobotError
from vsnbench.robots.checkup.ros2 import stored_watchdog_result
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.watchdog import (
    WatchdogMeasurement,
    require_watchdog,
    stopped_after_s,
    store_measurement,
    stored_measurement,
)
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.values.pose import Pose

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
