"""What `doctor --move` says about a base with dead time, motor lag, a deadband and noise, from synthetic odometry."""

import math
import random
import re
from collections.abc import Sequence

import pytest

from vsnbench.robots.checkup.response import (
    CommandedTurn,
    lateral_results,
    rate_of_new_values,
    response_of,
    response_results,
    slowest_turn,
)
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Tolerances

PROFILE = load_profile("turtlebot2")
STEP_S = 0.001
CLOCK_S = 500.0
"""The robot's clock is ahead by this."""
ONE = ((0.3, 1.0),)
STAIRS = tuple((-velocity, 0.8) for velocity in (0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.18, 0.25))


def turned(
    stages: Sequence[tuple[float, float]],
    *,
    dead_time_s: float = 0.0,
    lag_s: float = 0.0,
    deadband_rad_s: float = 0.0,
    rate_hz: float = 50.0,
    noise_deg: float = 0.0,
    repeated: int = 1,
) -> CommandedTurn:
    """Return the odometry of a base, each value sent `repeated` times with new stamps."""
    rng = random.Random(4)
    commands: list[tuple[float, float]] = []
    at_s = 0.5
    for velocity, lasting_s in (*stages, (0.0, 0.8)):
        commands += [(at_s + 0.02 * k, velocity) for k in range(round(lasting_s / 0.02))]
        at_s += lasting_s
    heading_rad, speed, readings, k, value_rad = 3.1, 0.0, [], -1, 3.1
    for tick in range(round((commands[-1][0]) / STEP_S)):
        now_s = tick * STEP_S
        while k + 1 < len(commands) and commands[k + 1][0] <= now_s - dead_time_s:
            k += 1
        wanted = commands[k][1] if k >= 0 else 0.0
        wanted = wanted if abs(wanted) >= deadband_rad_s else 0.0
        speed = wanted if not lag_s else speed + (wanted - speed) * STEP_S / lag_s
        heading_rad += speed * STEP_S
        if tick % round(1 / rate_hz / STEP_S) == 0:
            if len(readings) % repeated == 0:
                value_rad = heading_rad + rng.gauss(0, math.radians(noise_deg))
            pose = Pose(0.0, 0.0, math.remainder(value_rad, math.tau))
            readings.append(OdometryReading(pose, now_s + CLOCK_S, now_s + rng.uniform(0.0, 0.01)))
    return CommandedTurn(tuple(commands), tuple(readings))


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize(("dead_time_s", "lag_s"), [(0.0, 0.0), (0.05, 0.08), (0.1, 0.2), (0.2, 0.05)])
def test_dead_time_and_motor_lag_are_measured(rate_hz: float, dead_time_s: float, lag_s: float) -> None:
    response = response_of(turned(ONE, dead_time_s=dead_time_s, lag_s=lag_s, rate_hz=rate_hz, noise_deg=0.03))
    assert response is not None
    assert response.delay_s == pytest.approx(dead_time_s + lag_s, abs=0.04)
    assert response.dead_time_s == pytest.approx(dead_time_s, abs=0.05)


def test_a_base_that_does_not_turn_has_no_response() -> None:
    assert response_of(turned(ONE, deadband_rad_s=0.5)) is None


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize(("deadband_rad_s", "slowest"), [(0.0, 0.01), (0.04, 0.05), (0.1, 0.12), (0.2, 0.25)])
def test_the_slowest_turn_that_a_base_follows_is_found(rate_hz: float, deadband_rad_s: float, slowest: float) -> None:
    stairs = turned(STAIRS, deadband_rad_s=deadband_rad_s, rate_hz=rate_hz, dead_time_s=0.1, lag_s=0.05)
    assert slowest_turn(stairs, 0.15) == slowest


def test_noise_is_not_taken_for_a_turn() -> None:
    assert slowest_turn(turned(STAIRS, deadband_rad_s=0.5, noise_deg=0.3), 0.0) is None


@pytest.mark.parametrize(("rate_hz", "repeated", "new_hz"), [(10, 1, 10), (50, 1, 50), (50, 5, 10), (20, 2, 10)])
def test_repeated_values_do_not_count_as_new_odometry(rate_hz: float, repeated: int, new_hz: float) -> None:
    assert rate_of_new_values(turned(ONE, rate_hz=rate_hz, repeated=repeated)) == pytest.approx(new_hz, rel=0.15)


def findings(profile=PROFILE, **base: float) -> dict[str, tuple[str, str, str]]:
    results = list(response_results(profile, turned(ONE, **base), turned(STAIRS, **base)))
    return {result.what: (result.health.value, result.seen, result.advice) for result in results}


def test_an_ordinary_base_passes_with_its_measured_delay() -> None:
    found = findings(dead_time_s=0.06, lag_s=0.08)
    health, seen, _ = found["response"]
    assert health == "ok"
    dead_time_ms, lag_ms = (int(number) for number in re.findall(r"(\d+) ms", seen))
    assert dead_time_ms + lag_ms == pytest.approx(140, abs=20)
    assert found["slowest turn"] == ("ok", "the base follows 0.01 rad/s", "")
    assert "odometry rate" not in found


def test_a_finding_has_the_lines_for_the_profile() -> None:
    assert findings(rate_hz=50, repeated=5)["odometry rate"] == (
        "warning",
        "10.0 new values per second; the profile has 50 Hz",
        "put the measured rate into the profile: base: {odometry_rate_hz: 10}",
    )
    health, seen, advice = findings(deadband_rad_s=0.2)["slowest turn"]
    assert health == "warning"
    assert "0.25 rad/s, nothing slower: corrections can leave 0.14°" in seen
    assert advice.endswith("tolerances: {position_m: 0.005, turn_deg: 0.15}")
    coarse = PROFILE.model_copy(update={"tolerances": Tolerances(turn_deg=0.15)})
    assert findings(coarse, deadband_rad_s=0.2)["slowest turn"][0] == "ok"


def test_a_base_that_answers_too_late_fails() -> None:
    health, seen, advice = findings(dead_time_s=0.36, lag_s=0.2)["response"]
    assert health == "failed"
    assert "dead time 3" in seen
    assert advice == "run the control loop next to the base: vsnbench robots serve turtlebot2"


def test_a_base_that_does_not_turn_fails() -> None:
    found = findings(deadband_rad_s=0.5)
    assert found["response"][0] == "warning"
    assert found["slowest turn"][0] == "failed"


def test_a_dead_time_and_a_slowest_turn_that_are_not_the_profiles_are_warned_of() -> None:
    base = PROFILE.base.model_copy(update={"dead_time_s": 0.25, "min_angular_rad_s": 0.03})
    given = {"dead_time_s": 0.1, "deadband_rad_s": 0.1}
    results = response_results(PROFILE.model_copy(update={"base": base}), turned(ONE, **given), turned(STAIRS, **given))
    found = {result.what: (str(result.health), result.advice) for result in results}
    assert found["response"][0] == found["slowest turn"][0] == "warning"
    stated_s = re.search(r"dead_time_s: (\S+)}", found["response"][1])
    assert stated_s is not None
    assert float(stated_s.group(1)) == pytest.approx(0.1, abs=0.03)
    assert "min_angular_rad_s: 0.12" in found["slowest turn"][1]


def aside(stages: Sequence[tuple[float, float]], **base: float) -> CommandedTurn:
    """Return the odometry of a base that moves to the side as `turned` turns, and faces 40°."""
    turn = turned(stages, **base)
    start = Pose(2.0, -1.0, math.radians(40))
    readings = [
        OdometryReading(start.compose(Pose(0.0, amount - turn.covered[0][1])), reading.stamp_s, reading.arrival_s)
        for (_, amount), reading in zip(turn.covered, turn.readings, strict=True)
    ]
    return CommandedTurn(turn.commands, tuple(readings), is_lateral=True)


WAY, WAY_STAIRS = ((0.2, 1.5),), tuple((-velocity, 0.5) for velocity in (0.02, 0.04, 0.06, 0.09, 0.12))
OFTEN = load_profile("turtlebot2").base.model_copy(
    update={"track_m": None, "wheel_radius_m": None, "max_lateral_m_s": 0.4, "min_lateral_m_s": 0.02}
)


def test_the_response_to_the_side_is_measured_and_a_minimum_that_is_too_low_is_named() -> None:
    profile = PROFILE.model_copy(update={"base": OFTEN})
    base = {"dead_time_s": 0.1, "lag_s": 0.08}
    (good,) = lateral_results(profile, aside(WAY, **base), aside(WAY_STAIRS, **base))
    assert good.health.value == "ok"
    dead_ms, lag_ms = map(int, re.findall(r"(\d+) ms", good.seen))
    assert (dead_ms, lag_ms) == (pytest.approx(100, abs=15), pytest.approx(80, abs=25))
    deaf = base | {"deadband_rad_s": 0.05}
    (low,) = lateral_results(profile, aside(WAY, **deaf), aside(WAY_STAIRS, **deaf))
    assert "min_lateral_m_s: 0.06" in low.advice


def test_a_base_that_does_not_move_sideways_is_told_to_state_no_limit() -> None:
    still = aside(WAY, deadband_rad_s=9.0)
    (found,) = lateral_results(PROFILE.model_copy(update={"base": OFTEN}), still, still)
    assert "max_lateral_m_s" in found.advice
