"""A mover and the simulated base that it drives, in virtual time: load and luck play no part.

Time passes only while the mover, or the test, sleeps. The mover, its control law and the base are the real ones; only
the clock is this file's.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

from vsnbench.control.command import Command
from vsnbench.control.settings import MotionSettings
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.simulated_base import SimulatedBase
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import parse_site
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive, Move, Sidestep, Trajectory, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics, RobotProfile

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
_ON_LEGS = {"track_m": None, "wheel_radius_m": None, "max_lateral_m_s": 0.3}
LEGGED = PROFILE.model_copy(update={"base": PROFILE.base.model_copy(update=_ON_LEGS)})
"""A base that can also move sideways."""
REST_S = 0.5


def held(distance_m: float = 0.0, turn_deg: float = 0.0) -> Move:
    """An action of the paper."""
    return Move(distance_m, math.radians(turn_deg), holds_heading=True)


@dataclass
class Stand:
    """A mover on a simulated base."""

    dynamics: BaseDynamics = IDEAL_BASE
    noise: NoiseSettings | None = None
    profile: RobotProfile = PROFILE
    settings: MotionSettings | None = None
    seed: int = 5
    base: SimulatedBase = field(init=False)
    mover: Mover = field(init=False)
    held_rad: float | None = None
    """True heading that the actions of a session should keep; None before the first and after a failure."""
    _due_s: float = 0.0

    def __post_init__(self) -> None:
        limits = self.profile.base
        self.base = SimulatedBase(HALL, SCENE, self.profile, self.noise, self.dynamics)
        self.base.put_down(Pose(0.0, 0.0, 0.3), self.seed)
        self.settings = self.settings or MotionSettings.for_robot(self.profile)
        self.rate_hz = self.dynamics.odometry_rate_hz or limits.odometry_rate_hz
        tracker = OdometryTracker(limits.max_linear_m_s, limits.max_angular_rad_s)

        def now_s() -> float:
            return self.base.now_s

        self.mover = Mover(self.hear, self.settings, tracker, now_s, self.sleep_until, now_s)
        self.sleep_until(1.5)

    def hear(self, command: Command) -> None:
        """Pass a command of the mover to the base."""
        self.base.set_command(command)

    def sleep_until(self, due_s: float) -> None:
        while self.base.now_s < due_s - 1e-9:
            self.base.advance()
            now_s = self.base.now_s
            if now_s >= self._due_s - 1e-6:
                self._due_s = max(self._due_s + 1 / self.rate_hz, now_s)
                self.report(self.base.read_odometry())

    def report(self, pose: Pose) -> None:
        """Pass a reading of the odometry to the mover."""
        self.mover.take_odometry(pose.x_m, pose.y_m, math.remainder(pose.heading_rad, math.tau), self.base.now_s)

    def drive(self, movement: Drive) -> MotionResult:
        """Have a movement executed, and wait until the base is at rest."""
        result = self.mover.drive(movement, lambda: False)
        self.sleep_until(self.base.now_s + REST_S)
        return result


POSITION_M = 0.015
"""Largest true error of a waypoint or the end of a trajectory that was answered True."""
FACING_RAD = math.radians(10)
"""Largest true difference between the robot's heading and the direction in which it should look at the end."""


@dataclass(frozen=True)
class Trial:
    """One movement, judged by the true poses of the base."""

    result: MotionResult
    off_m: float
    """Distance from the requested position, or error of a move's length."""
    off_rad: float
    """Difference from the requested heading, or from the direction of the end of the path."""
    took_s: float
    turned: bool = False
    """Whether the movement was a turn."""

    def is_true(self, kind: str) -> bool:
        """Return whether the movement was what was requested, within the tolerances."""
        if kind == "turn" or (kind == "session" and self.turned):
            return self.off_rad < SETTINGS.heading_tolerance_rad and self.off_m < 0.05
        if kind in ("move", "session"):
            return self.off_m < SETTINGS.position_tolerance_m and self.off_rad < FACING_RAD
        return self.off_m < POSITION_M and self.faces

    @property
    def faces(self) -> bool:
        return self.off_rad < FACING_RAD


def trial(stand: Stand, kind: str, movement: Drive) -> Trial:
    """Have one movement executed and compare it with what was requested.

    Args:
        stand: base and mover.
        kind: turn, move, session (turns and moves that keep a heading), waypoint, trajectory, S-curve or sidestep.
        movement: the movement.
    """
    if math.hypot(*stand.base.pose.position) > 20:  # before it reaches the wall
        stand.base.put_down(Pose(0.0, 0.0, stand.base.pose.heading_rad), stand.seed)
        stand.sleep_until(stand.base.now_s + 3 * REST_S)
    before, began_s = stand.base.pose, stand.base.now_s
    if kind != "session" or stand.held_rad is None:
        stand.mover.forget_heading()
        stand.held_rad = before.heading_rad
    result = stand.mover.drive(movement, lambda: False)
    took_s = stand.base.now_s - began_s
    stand.sleep_until(stand.base.now_s + REST_S)
    after = stand.base.pose
    if isinstance(movement, Move):
        stand.held_rad += movement.turn_rad
        wanted = Pose(*before.position, stand.held_rad)
        off_m = abs(after.distance_to(before) - abs(movement.distance_m))
    elif isinstance(movement, Sidestep):
        wanted = before.compose(Pose(0.0, movement.left_m))
        off_m = after.distance_to(wanted)
    else:
        assert isinstance(movement, Waypoint | Trajectory)
        points = [
            (0.0, 0.0),
            *(movement.points if isinstance(movement, Trajectory) else [(movement.x_m, movement.y_m)]),
        ]
        (ax, ay), (bx, by) = points[-2:]
        wanted = before.compose(Pose(bx, by, math.atan2(by - ay, bx - ax)))
        off_m = after.distance_to(wanted)
    off_rad = abs(math.remainder(after.heading_rad - wanted.heading_rad, math.tau))
    if not result.completed:
        stand.held_rad = None
    return Trial(result, off_m, off_rad, took_s, isinstance(movement, Move) and movement.turn_rad != 0)


def movements(kind: str, count: int, seed: int) -> list[Drive]:
    """Return random movements of a kind."""
    choice = random.Random(f"{kind} {seed}")
    return [_MADE[kind](choice) for _ in range(count)]


def _trajectory(choice: random.Random) -> Trajectory:
    """A smooth bend of 1.0 to 2.5 m to one side, as a path planner returns it."""
    length_m, bend_rad = choice.uniform(1.0, 2.5), choice.choice([-1, 1]) * choice.uniform(0.2, 1.2)
    return _curve(length_m, lambda share: bend_rad * share)


def _s_curve(choice: random.Random) -> Trajectory:
    """A bend to one side and back: the turn reverses."""
    length_m, bend_rad = choice.uniform(1.2, 2.5), choice.choice([-1, 1]) * choice.uniform(0.4, 1.0)
    return _curve(length_m, lambda share: bend_rad * math.sin(math.tau * share))


def _curve(length_m: float, heading_rad: Callable[[float], float]) -> Trajectory:
    step_m, x_m, y_m, points = 0.05, 0.0, 0.0, []
    count = round(length_m / step_m)
    for k in range(count):
        toward_rad = heading_rad((k + 0.5) / count)
        x_m, y_m = x_m + step_m * math.cos(toward_rad), y_m + step_m * math.sin(toward_rad)
        points.append((x_m, y_m))
    return Trajectory(tuple(points))


def _waypoint(choice: random.Random) -> Waypoint:
    reach_m, bearing_rad = choice.uniform(0.3, 2.5), choice.uniform(-math.pi, math.pi)
    return Waypoint(reach_m * math.cos(bearing_rad), reach_m * math.sin(bearing_rad))


_MADE: dict[str, Callable[[random.Random], Drive]] = {
    "turn": lambda choice: held(turn_deg=choice.choice([-1.0, 1.0]) * choice.choice([15, 30, 30, 90])),
    "move": lambda choice: held(choice.choice([0.25, 0.25, -0.25])),
    "session": lambda choice: choice.choice([held(0.25), held(turn_deg=choice.choice([-30.0, 30.0]))]),
    "waypoint": _waypoint,
    "trajectory": _trajectory,
    "S-curve": _s_curve,
    "sidestep": lambda choice: Sidestep(choice.choice([-1, 1]) * choice.choice([0.1, 0.25, 0.25, 0.5, 1.0])),
}
KINDS = tuple(_MADE)


def stand_for(kind: str, dynamics: BaseDynamics = IDEAL_BASE) -> Stand:
    """Return a stand whose base can make a kind of movement."""
    return Stand(dynamics, profile=LEGGED if kind == "sidestep" else PROFILE)
