"""Dead time and lag of a base are measured from a movement, and what is commanded but not measured follows."""

import math

import pytest

from vsnbench.control.command import Command
from vsnbench.control.response import BaseResponse, ResponseMeter, SentCommands, measured_response
from vsnbench.control.settings import MotionSettings
from vsnbench.control.slowest import SlowestVelocity
from vsnbench.values.pose import Pose

PERIOD_S = 0.02


def profile_of(dead_time_s: float, lag_s: float, rate_hz: float) -> tuple[list[tuple[float, float]], ...]:
    """Commands of a ramp up and down, and the exact answer of a first-order base at the times of its odometry."""
    commands = [(k * PERIOD_S, 0.3 * min(k / 20, 1.0, (100 - k) / 30)) for k in range(101)]
    step_s, velocity, way, readings = 0.001, 0.0, 0.0, []
    for tick in range(3000):
        at_s = tick * step_s
        index = math.floor((at_s - dead_time_s) / PERIOD_S + 1e-9)
        wanted = commands[min(index, 100)][1] if index >= 0 else 0.0
        velocity = wanted if lag_s == 0 else velocity + (wanted - velocity) * (1 - math.exp(-step_s / lag_s))
        way += velocity * step_s
        if tick % round(1000 / rate_hz) == 0:
            readings.append((at_s + step_s, way))
    return commands, readings


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize(("dead_time_s", "lag_s"), [(0.0, 0.0), (0.05, 0.08), (0.15, 0.2), (0.1, 0.02)])
def test_dead_time_and_lag_are_found(dead_time_s: float, lag_s: float, rate_hz: float) -> None:
    response = measured_response(*profile_of(dead_time_s, lag_s, rate_hz), least=0.05)
    assert response is not None
    assert response.delay_s == pytest.approx(dead_time_s + lag_s, abs=0.012)
    assert response.lag_s == pytest.approx(lag_s, abs=0.035)


def test_a_short_movement_or_one_that_does_not_follow_shows_no_response() -> None:
    commands, readings = profile_of(0.05, 0.08, 50)
    assert measured_response(commands, [(at_s, way / 20) for at_s, way in readings], least=0.05) is None
    blocked = [(at_s, min(way, 0.2)) for at_s, way in readings]
    assert measured_response(commands, blocked, least=0.05) is None
    assert measured_response(commands, readings[:5], least=0.05) is None
    late = [(at_s - 60, way) for at_s, way in readings]
    assert measured_response(commands, late, least=0.05) is None, "a simulator that falls behind, by its stamps"


def test_a_meter_keeps_the_median_and_the_slowest_velocity_of_each_axis() -> None:
    meter = ResponseMeter()
    assert meter.response is None
    for lag_s in (0.08, 0.08, 0.2):
        commands, readings = profile_of(0.05, lag_s, 50)
        sent = [(at_s, Command(velocity)) for at_s, velocity in commands]
        poses = [(at_s, Pose(way, 0.0)) for at_s, way in readings]
        meter.add(0.04, Pose(0.0, 0.0), sent, poses, turns=False)
    assert meter.response is not None
    assert meter.response.lag_s == pytest.approx(0.08, abs=0.02)
    assert (meter.response.slowest_m_s, meter.response.slowest_rad_s) == (0.04, 0.0)


@pytest.mark.parametrize("lag_s", [0.0, 0.08, 0.2])
def test_what_is_pending_is_what_the_base_still_moves(lag_s: float) -> None:
    commands, readings = profile_of(0.05, lag_s, 50)
    sent = SentCommands(BaseResponse(0.05, lag_s))
    total = readings[-1][1]
    due = {round(at_s, 3): way for at_s, way in readings}
    for at_s, velocity in commands:
        stamp_s = round(at_s - PERIOD_S + 0.001, 3)
        if stamp_s in due and at_s > 0.2:
            commanded = sum(v for t, v in commands if t < at_s - 1e-9) * PERIOD_S
            pending_m, pending_rad = sent.pending(at_s, stamp_s)
            assert due[stamp_s] + pending_m == pytest.approx(commanded, abs=0.0015)
            assert pending_rad == 0.0
        sent.add(at_s, Command(velocity))
    assert total == pytest.approx(sum(v for _, v in commands) * PERIOD_S, abs=0.001)


def test_a_slow_velocity_is_raised_only_until_the_base_moves_and_to_half_of_its_cruise() -> None:
    slowest = SlowestVelocity(0.0, 0.3, 0.005, MotionSettings())
    commanded = at_s = 0.0
    for _ in range(2000):
        at_s += PERIOD_S
        commanded += 0.02 * PERIOD_S
        slowest.look(at_s, 0.05, commanded, 0.02, 0.1)
    assert slowest.velocity == pytest.approx(0.15)
    moving = SlowestVelocity(0.0, 0.3, 0.005, MotionSettings())
    for k in range(200):
        moving.look(k * PERIOD_S, 0.05 - 0.02 * k * PERIOD_S, 0.02 * k * PERIOD_S, 0.02, 0.1)
    assert moving.velocity == 0.0


def test_slow_turns_are_given_in_single_fast_enough_periods() -> None:
    slowest = SlowestVelocity(0.1, 0.5, math.inf, MotionSettings())
    turned = [slowest.in_turns(0.03, PERIOD_S) for _ in range(100)]
    assert set(turned) == {0.0, 0.1}
    assert sum(turned) == pytest.approx(3.0, abs=0.11)
    assert slowest.in_turns(0.3, PERIOD_S) == 0.3


def test_the_rest_of_a_correction_is_covered_in_whole_periods() -> None:
    slowest = SlowestVelocity(0.05, 0.3, 0.005, MotionSettings())
    velocity = slowest.raised(0.01, 0.0025, PERIOD_S)
    assert velocity == pytest.approx(0.0625)
    assert 0.0025 / (velocity * PERIOD_S) == pytest.approx(2)


@pytest.mark.parametrize(("turns", "least"), [(False, 0.8), (True, 0.5)])
def test_a_base_that_makes_half_of_its_commands_is_never_driven_forward_much_faster(turns: bool, least: float) -> None:
    meter = ResponseMeter()
    commands, readings = profile_of(0.05, 0.08, 50)
    sent = [(at_s, Command(0.0, velocity) if turns else Command(velocity)) for at_s, velocity in commands]
    poses = [(at_s, Pose(0.0, 0.0, way / 2) if turns else Pose(way / 2, 0.0)) for at_s, way in readings]
    meter.add(0.0, Pose(0.0, 0.0), sent, poses, turns=turns)
    assert meter.response is not None
    scaled = meter.response.scaled(Command(0.2, 0.4))
    assert (scaled.angular_rad_s if turns else scaled.linear_m_s) == pytest.approx(
        (0.4 if turns else 0.2) / least, rel=0.02
    )
