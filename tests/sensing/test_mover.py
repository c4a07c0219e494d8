"""The mover on a base with noise and latency, on a counted clock: True means within tolerance."""

import math
import random
from typing import Any

import pytest

from tests.movements import BACKWARD, FORWARD, LEFT, RIGHT
from tests.sensing.stand import PROFILE, REST_S, Stand
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.values.movement import STOP, Move
from vsnbench.values.robot_profile import BaseDynamics, Tolerances


@pytest.mark.parametrize(
    ("lag_s", "noise", "rate_hz"), [(0.1, True, 50), (0.1, True, 20), (0.0, True, 50), (0.1, False, 10)]
)
def test_true_is_within_tolerance_of_the_heading_that_is_held(lag_s: float, noise: bool, rate_hz: float) -> None:
    """The tolerance applies to absolute headings; between calls, two errors and the end of a move add up."""
    late = BaseDynamics(dead_time_s=lag_s, odometry_rate_hz=rate_hz)
    stand = Stand(late, NoiseSettings() if noise else None, seed=8)
    choice = random.Random(8)
    before = stand.base.odometry
    held_rad = before.heading_rad
    worst_absolute = worst_relative = 0.0
    for _ in range(40):
        movement = choice.choices([FORWARD, BACKWARD, LEFT, RIGHT], [4, 1, 3, 3])[0]
        assert stand.drive(movement).completed
        after = stand.base.odometry
        if movement.turn_rad:
            asked_rad = movement.turn_rad
            held_rad += asked_rad
            worst_absolute = max(worst_absolute, abs(math.remainder(after.heading_rad - held_rad, math.tau)))
            worst_relative = max(worst_relative, abs(after.heading_rad - before.heading_rad - asked_rad))
        else:
            assert abs(before.distance_to(after) - 0.25) < 0.005
        before = after
    assert worst_absolute < math.radians(0.1)
    if noise:
        # The difference of two headings also includes the correction of the previous move's error.
        assert worst_relative > math.radians(0.1)


def test_stop_needs_no_odometry_and_moves_nothing() -> None:
    sent: list[Command] = []
    tracker = OdometryTracker(1.0, 1.0)
    mover = Mover(sent.append, MotionSettings(), tracker, lambda: 0.0, lambda _due_s: None, lambda: 0.0)
    assert mover.drive(STOP, lambda: False).completed
    assert sent == [STANDSTILL]
    assert "no odometry" in mover.drive(FORWARD, lambda: False).failure


def test_a_request_that_comes_while_its_node_closes_moves_nothing() -> None:
    stand = Stand()
    stood_at = stand.base.odometry
    stand.mover.stop("closing")
    assert (result := stand.drive(FORWARD)).failure == "closing"
    assert not result.completed
    assert stand.base.odometry.distance_to(stood_at) < 1e-6


def noisy_stand(rate_hz: float, heading_deg: float = 0.0, position_m: float = 0.0, **more: Any) -> Stand:
    dynamics = BaseDynamics(odometry_rate_hz=rate_hz, heading_noise_deg=heading_deg, position_noise_m=position_m)
    return Stand(dynamics, **more)


def durations_s(stand: Stand, movements: int) -> list[float]:
    """Return the durations of random movements, all answered True and truly within tolerance."""
    choice, took_s = random.Random(5), []
    held_rad = stand.base.odometry.heading_rad
    for _ in range(movements):
        movement = choice.choices([FORWARD, BACKWARD, LEFT, RIGHT], [4, 1, 3, 3])[0]
        before, began_s = stand.base.odometry, stand.base.now_s
        result = stand.mover.drive(movement, lambda: False)
        assert result.completed, result.failure
        took_s.append(stand.base.now_s - began_s)
        after = stand.base.odometry
        if movement.turn_rad:
            held_rad += movement.turn_rad
            assert abs(math.remainder(after.heading_rad - held_rad, math.tau)) < math.radians(0.1)
        else:
            assert abs(before.distance_to(after) - 0.25) < 0.005
    return took_s


def test_a_movement_whose_control_loop_paused_does_not_go_on() -> None:
    stand = Stand()
    periods = 0

    def suspended_once() -> bool:
        nonlocal periods
        periods += 1
        if periods == 20:
            stand.sleep_until(stand.base.now_s + 1.0)
        return False

    result = stand.mover.drive(FORWARD, suspended_once)
    assert not result.completed
    assert "paused for 1.0 s" in result.failure
    stand.sleep_until(stand.base.now_s + REST_S)
    stood_at = stand.base.odometry
    stand.sleep_until(stand.base.now_s + REST_S)
    assert stand.base.odometry.distance_to(stood_at) < 1e-6


@pytest.mark.parametrize("rate_hz", [20, 50])
@pytest.mark.parametrize(("heading_deg", "position_m"), [(0.01, 0.0005), (0.03, 0.001), (0.05, 0.002)])
def test_a_base_with_noise_at_rest_moves_accurately(rate_hz, heading_deg, position_m) -> None:
    quiet = durations_s(noisy_stand(rate_hz), 30)
    noisy = durations_s(noisy_stand(rate_hz, heading_deg, position_m), 30)
    longer = sorted(after / before for before, after in zip(quiet, noisy, strict=True))
    assert longer[26] < 2


@pytest.mark.parametrize(("movement", "says"), [(LEFT, "0.1°"), (FORWARD, "5 mm")])
def test_noise_too_large_to_average_is_named_and_nothing_moves(movement, says) -> None:
    stand = noisy_stand(20, heading_deg=0.15, position_m=0.008)
    before = stand.base.pose
    result = stand.mover.drive(movement, lambda: False)
    assert not result.completed
    assert result.failure.startswith("odometry noise of ")
    assert result.failure.endswith(f"too large for {says}")
    assert stand.base.pose.distance_to(before) < 1e-4
    assert stand.base.pose.heading_rad == pytest.approx(before.heading_rad, abs=1e-4)


def test_a_movement_that_its_caller_ends_by_an_exception_leaves_a_base_that_rests() -> None:
    stand = noisy_stand(20, heading_deg=0.03, position_m=0.001)
    (usual_s,) = durations_s(stand, 1)
    give_up_s = stand.base.now_s + 1.0

    def looks() -> bool:
        if stand.base.now_s > give_up_s:
            raise InterruptedError
        return False

    with pytest.raises(InterruptedError):
        stand.mover.drive(Move(1.0), looks)
    stand.sleep_until(stand.base.now_s + 1.0)
    assert stand.drive(FORWARD).duration_s < usual_s + 0.5


def test_larger_tolerances_in_the_profile_serve_a_less_accurate_base() -> None:
    coarse = PROFILE.model_copy(update={"tolerances": Tolerances(position_m=0.02, turn_deg=0.5)})
    settings = MotionSettings.for_robot(coarse)
    stand = noisy_stand(20, heading_deg=0.15, position_m=0.006, settings=settings)
    before = stand.base.odometry
    assert stand.drive(LEFT).completed
    turned_rad = stand.base.odometry.heading_rad - before.heading_rad
    assert turned_rad == pytest.approx(math.radians(30), abs=math.radians(0.5))
    assert coarse.sha256 != PROFILE.sha256


def test_a_rival_publisher_ends_the_movement_by_its_name() -> None:
    stand = Stand()

    def joystick_moves() -> bool:
        if stand.base.now_s > 0.8:
            stand.mover.take_rival("/joystick commands /cmd_vel as well")
        return False

    result = stand.mover.drive(FORWARD, joystick_moves)
    assert (result.completed, result.failure) == (False, "/joystick commands /cmd_vel as well")
    assert result.duration_s < 0.7
    assert stand.mover.drive(BACKWARD, lambda: False).completed


@pytest.mark.parametrize("is_known", [True, False])
def test_a_base_that_was_moved_before_its_first_movement_is_still_known_to_be_noisy(is_known: bool) -> None:
    """By a check-up, which the mover knows of, or by a hand that placed the robot."""
    late = BaseDynamics(dead_time_s=0.05, motor_time_constant_s=0.08, heading_noise_deg=0.03, odometry_rate_hz=20)
    stand = Stand(late)
    for number in range(200):
        if is_known:
            stand.mover.take_other_command()
        stand.base.set_command(Command(0.0, 0.3 if number < 100 else -0.1))
        stand.sleep_until(stand.base.now_s + 0.02)
    stand.base.set_command(STANDSTILL)
    result = stand.drive(LEFT)
    assert result.completed, result.failure
    assert result.duration_s < 6.0
