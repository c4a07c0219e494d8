"""Check of the watchdog of a base that the workstation steers."""

from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.ros.watchdog import WatchdogMeasurement, robot_option, stored_measurement, watchdog_advice
from vsnbench.values.robot_profile import RobotProfile


def watchdog_result(measurement: WatchdogMeasurement, profile: RobotProfile) -> CheckResult:
    """Return whether a measurement passed."""
    if measurement.passed:
        return CheckResult("watchdog", Health.OK, measurement.seen)
    return CheckResult("watchdog", Health.FAILED, measurement.seen, watchdog_advice(profile))


def stored_watchdog_result(profile: RobotProfile, *, simulated: bool) -> CheckResult:
    """Return whether the stored measurement of a base passed."""
    measurement = stored_measurement(profile, simulated=simulated)
    if measurement is None:
        seen = "not measured on this machine: vsnbench run will not steer the base"
        return CheckResult("watchdog", Health.WARNING, seen, f"vsnbench doctor --robot {robot_option(profile)} --move")
    result = watchdog_result(measurement, profile)
    seen = f"{result.seen} ({measurement.measured_at:%Y-%m-%d})"
    return CheckResult(result.what, result.health, seen, result.advice)
