"""The mover on a base with noise and a dead time, on a counted clock: True means within tolerance."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from vsnbench.motion.controller import Command
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import parse_site
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.discrete_mover import DiscreteMover
from vsnbench.sensing.odometry import OdometryTracker
from vsnbench.simulator.noise import NoiseSettings
from vsnbench.simulator.scene import build_scene
from vsnbench.simulator.simulated_base import SimulatedBase

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
    mover: DiscreteMover = field(init=False)
    _due_s: float = 0.0

    def __post_init__(self) -> None:
        tracker = OdometryTracker(PROFILE.base.max_linear_m_s, PROFILE.base.max_angular_rad_s)
        hear: Callable[[Command], None] = self.base.hear
        self.mover = DiscreteMover(hear, SETTINGS, tracker, lambda: self.base.now_s, self.sleep_until)
        self.sleep_until(0.2)

    def sleep_until(self, due_s: float) -> None:
        while self.base.now_s < due_s - 1e-9:
            self.base.advance()
            if self.base.now_s >= self._due_s - 1e-6:
                self._due_s = self.base.now_s + 1 / self.rate_hz
                pose = self.base.odometry
                self.mover.take_odometry(
                    pose.x_m, pose.y_m, math.remainder(pose.heading_rad, math.tau), self.base.now_s
                )

    def ask(self, movement: str, angle_deg: int) -> tuple[bool, Pose]:
        """Return the answer, and where the odometry stands half a second later, when nothing rolls any more."""
        answer = self.mover.carry_out(movement, angle_deg, lambda: False).answer
        self.sleep_until(self.base.now_s + REST_S)
        return answer, self.base.odometry


@pytest.mark.parametrize(
    ("lag_s", "noise", "rate_hz"), [(0.1, True, 50), (0.1, True, 20), (0.0, True, 50), (0.1, False, 10)]
)
def test_true_is_within_tolerance_of_the_heading_that_is_held(lag_s: float, noise: bool, rate_hz: float) -> None:
    """Absolute headings are what is promised; from call to call two of them, and a move's end between, add up."""
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE, NoiseSettings() if noise else None, lag_s), rate_hz)
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
        # What a caller sees who subtracts two headings: where the move before had left the robot is turned back, too.
        assert worst_relative > math.radians(0.13)


@pytest.mark.parametrize("word", ["Left", "Right"])
def test_a_turn_of_zero_degrees_turns_nothing(word: str) -> None:
    stand = Stand(SimulatedBase(HALL, SCENE, PROFILE), 50)
    before = stand.base.odometry
    answer, after = stand.ask(word, 0)
    assert answer
    assert after.heading_rad == pytest.approx(before.heading_rad, abs=1e-6)
