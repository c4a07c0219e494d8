"""The mover on a base with noise and latency, on a counted clock: True means within tolerance."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from vsnbench.control.command import Command
from vsnbench.control.settings import MotionSettings
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.discrete_mover import DiscreteMover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.simulated_base import SimulatedBase
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import parse_site
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import BaseDynamics, Tolerances

HALL = parse_site(
    """
name: hall
rooms: [{name: hall, polygon: [[-25, -25], [25, -25], [25, 25], [-25, 25]]}]
walls: [{start: [-25, -25], end: [25, -25]}]
starts: [{number: 1, position: [0, 0], heading_deg: 17}]
""",
    origin="hall",
)
SCENE = build_scene(HALL)
PROFILE = load_profile("turtlebot2")
SETTINGS = MotionSettings.for_robot(PROFILE)
REST_S = 0.5


@dataclass
class Stand:
    """A mover and the base it drives; time passes only while the mover, or the test, sleeps."""

    base: SimulatedBase
    rate_hz: float
    heading_deg: float = 0.0
    """Standard deviation of white noise on the odometry, also at rest; `position_m` in the same way."""
    position_m: float = 0.0
    settings: MotionSettings = SETTINGS
    mover: DiscreteMover = field(init=False)
    _rng: random.Random = field(default_factory=lambda: random.Random(5))
    _due_s: float = 0.0

    def __post_init__(self) -> None:
        tracker = OdometryTracker(PROFILE.base.max_linear_m_s, PROFILE.base.max_angular_rad_s)
        hear: Callable[[Command], None] = self.base.set_command
        self.mover = DiscreteMover(hear, self.settings, tracker, lambda: self.base.now_s, self.sleep_until)
        self.sleep_until(0.2)

    def sleep_until(self, due_s: float) -> None:
        while self.base.now_s < due_s - 1e-9:
            self.base.advance()
            if self.base.now_s >= self._due_s - 1e-6:
                self._due_s = self.base.now_s + 1 / self.rate_hz
                pose, rng = self.base.odometry, self._rng
                heading_rad = pose.heading_rad + rng.gauss(0, math.radians(self.heading_deg))
                x_m, y_m = pose.x_m + rng.gauss(0, self.position_m), pose.y_m + rng.gauss(0, self.position_m)
                self.mover.take_odometry(x_m, y_m, math.remainder(heading_rad, math.tau), self.base.now_s)

    def ask(self, movement: str, angle_deg: int) -> tuple[bool, Pose]:
        """Return the answer, and the odometry half a second later, when the base is at rest."""
        answer = self.mover.carry_out(movement, angle_deg, lambda: False).answer
        self.sleep_until(self.base.now_s + REST_S)
        return answer, self.base.odometry


@pytest.mark.parametrize(
    ("lag_s", "noise", "rate_hz"), [(0.1, True, 50), (0.1, True, 20), (0.0, True, 50), (0.1, False, 10)]
)
def test_true_is_within_tolerance_of_the_heading_that_is_held(lag_s: float, noise: bool, rate_hz: float) -> None:
    """The tolerance applies to absolute headings; between calls, two errors and the end of a move add up."""
    stand = Stand(
        SimulatedBase(HALL, SCENE, PROFILE, NoiseSettings() if noise else None, BaseDynamics(dead_time_s=lag_s)),
        rate_hz,
    )
    stand.base.put_down(Pose(0.0, 0.0, 0.3), seed=8)
    stand.sleep_until(stand.base.now_s + REST_S)
    choice = random.Random(8)
    before = stand.base.odometry
    held_rad = before.heading_rad
    worst_absolute = worst_relative = 0.0
    for _ in range(40):
        word = choice.choices(["Forward", "Backward", "Left", "Right"], [4, 1, 3, 3])[0]
        answer, after = stand.ask(word, 30)
        assert answer
        if word in ("Left", "Right"):
            asked_rad = math.radians(30) * (1 if word == "Left" else -1)
            held_rad += asked_rad
            worst_absolute = max(worst_absolute, abs(math.remainder(after.heading_rad - held_rad, math.tau)))
            worst_relative = max(worst_relative, abs(after.heading_rad - before.heading_rad - asked_rad))
        else:
            assert abs(before.distance_to(after) - 0.25) < 0.005
        before = after
    assert worst_absolute < math.radians(0.1)
    if noise:
        # The difference of two headings also includes the correction of the previous move's error.
        assert worst_relative > math.radians(0.13)


@pytest.mark.parametrize("word", ["Left", "Right"])
def test_a_turn_of_zero_degrees_turns_nothing(word: str) -> None:
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE), 50)
    before = stand.base.odometry
    answer, after = stand.ask(word, 0)
    assert answer
    assert after.heading_rad == pytest.approx(before.heading_rad, abs=1e-6)


def noisy_stand(rate_hz: float, heading_deg: float = 0.0, position_m: float = 0.0, **more: Any) -> Stand:
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE), rate_hz, heading_deg, position_m, **more)
    stand.sleep_until(1.5)
    return stand


def durations_s(stand: Stand, movements: int) -> list[float]:
    """Return the durations of random movements, all answered True and truly within tolerance."""
    choice, took_s = random.Random(5), []
    held_rad = stand.base.odometry.heading_rad
    for _ in range(movements):
        word = choice.choices(["Forward", "Backward", "Left", "Right"], [4, 1, 3, 3])[0]
        before, began_s = stand.base.odometry, stand.base.now_s
        outcome = stand.mover.carry_out(word, 30, lambda: False)
        assert outcome.answer, outcome.reason
        took_s.append(stand.base.now_s - began_s)
        after = stand.base.odometry
        if word in ("Left", "Right"):
            held_rad += math.radians(30) * (1 if word == "Left" else -1)
            assert abs(math.remainder(after.heading_rad - held_rad, math.tau)) < math.radians(0.1)
        else:
            assert abs(before.distance_to(after) - 0.25) < 0.005
    return took_s


def test_a_movement_whose_control_loop_paused_does_not_go_on() -> None:
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE, command_timeout_s=REST_S), 50)
    periods = 0

    def suspended_once() -> bool:
        nonlocal periods
        periods += 1
        if periods == 20:
            stand.sleep_until(stand.base.now_s + 1.0)
        return False

    outcome = stand.mover.carry_out("Forward", 0, suspended_once)
    assert not outcome.answer
    assert "paused for 1.0 s" in outcome.reason
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


@pytest.mark.parametrize(("word", "says"), [("Left", "0.1°"), ("Forward", "5 mm")])
def test_noise_too_large_to_average_is_named_and_nothing_moves(word, says) -> None:
    stand = noisy_stand(20, heading_deg=0.15, position_m=0.008)
    before = stand.base.pose
    outcome = stand.mover.carry_out(word, 30, lambda: False)
    assert not outcome.answer
    assert outcome.reason.startswith("odometry noise of ")
    assert outcome.reason.endswith(f"too large for {says}")
    assert stand.base.pose.distance_to(before) < 1e-4
    assert stand.base.pose.heading_rad == pytest.approx(before.heading_rad, abs=1e-4)


def test_larger_tolerances_in_the_profile_serve_a_less_accurate_base() -> None:
    coarse = PROFILE.model_copy(update={"tolerances": Tolerances(position_m=0.02, turn_deg=0.5)})
    settings = MotionSettings.for_robot(coarse)
    stand = noisy_stand(20, heading_deg=0.15, position_m=0.006, settings=settings)
    before = stand.base.odometry
    assert stand.ask("Left", 30)[0]
    turned_rad = stand.base.odometry.heading_rad - before.heading_rad
    assert turned_rad == pytest.approx(math.radians(30), abs=math.radians(0.5))
    assert coarse.sha256 != PROFILE.sha256


def test_a_rival_publisher_ends_the_movement_by_its_name() -> None:
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE), 50)

    def joystick_moves() -> bool:
        if stand.base.now_s > 0.8:
            stand.mover.take_rival("/joystick commands /cmd_vel as well")
        return False

    outcome = stand.mover.carry_out("Forward", 0, joystick_moves)
    assert (outcome.answer, outcome.reason) == (False, "/joystick commands /cmd_vel as well")
    assert outcome.duration_s < 0.7
    assert stand.mover.carry_out("Backward", 0, lambda: False).answer
