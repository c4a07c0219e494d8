"""Faults during every movement, in virtual time: the reason of the end, and when zero velocity is commanded.

The limits hold for the rules of the mover alone. Over ROS, the transport of messages and a busy machine add to them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing import discrete_mover
from vsnbench.sensing.discrete_mover import DiscreteMover
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.movements import Outcome
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.values.movement import Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

PROFILE = load_profile("turtlebot2")
SETTINGS = MotionSettings.for_robot(PROFILE)
STEP_S = 0.005
RATE_HZ = 50.0
FAULT_S = 1.0
AT_ONCE_S = 2 * SETTINGS.control_period_s + 1 / RATE_HZ
"""The fault arrives with a message, and the next control period acts on it."""


@dataclass
class VirtualBase:
    """A base that follows commands at once, and its mover; time passes only while the mover sleeps."""

    fault: Callable[["VirtualBase"], None] = lambda _: None
    """Called once, after a second of driving."""
    now_s: float = 0.0
    pose: Pose = field(default_factory=lambda: Pose(0.0, 0.0, 0.3))
    command: Command = STANDSTILL
    sent: list[tuple[float, Command]] = field(default_factory=list)
    is_silent: bool = False
    is_stuck: bool = False
    jump_m: float = 0.0
    is_nan: bool = False
    caller_is_gone: bool = False
    fault_s: float | None = None
    mover: DiscreteMover = field(init=False)

    def __post_init__(self) -> None:
        self._odometry_due_s = self._driven_s = 0.0
        tracker = OdometryTracker(PROFILE.base.max_linear_m_s, PROFILE.base.max_angular_rad_s)
        self.mover = DiscreteMover(self.hear, SETTINGS, tracker, lambda: self.now_s, self.sleep_until)
        self.sleep_until(1.0)

    def hear(self, command: Command) -> None:
        self.command = command
        self.sent.append((self.now_s, command))

    def sleep_until(self, due_s: float) -> None:
        while self.now_s < due_s - 1e-9:
            self.now_s += STEP_S
            self._advance()

    def _advance(self) -> None:
        moved = STANDSTILL if self.is_stuck else self.command
        self._driven_s += STEP_S if self.command != STANDSTILL else 0.0
        if self._driven_s >= FAULT_S and self.fault_s is None:
            self.fault_s = self.now_s
            self.fault(self)
        heading_rad = self.pose.heading_rad + moved.angular_rad_s * STEP_S
        self.pose = Pose(
            self.pose.x_m + moved.linear_m_s * STEP_S * math.cos(heading_rad),
            self.pose.y_m + moved.linear_m_s * STEP_S * math.sin(heading_rad),
            heading_rad,
        )
        if self.now_s >= self._odometry_due_s - 1e-9 and not self.is_silent:
            self._odometry_due_s = self.now_s + 1 / RATE_HZ
            x_m = math.nan if self.is_nan else self.pose.x_m + self.jump_m
            self.mover.take_odometry(x_m, self.pose.y_m, math.remainder(heading_rad, math.tau), self.now_s)

    def execute(self, movement: str) -> Outcome:
        def gone() -> bool:
            return self.caller_is_gone

        if movement in DRIVES:
            return self.mover.drive(DRIVES[movement], gone)
        return self.mover.carry_out(movement, 30, gone)

    @property
    def zeroed_after_s(self) -> float:
        """Time from the fault to the first of the zero velocities for good."""
        assert self.fault_s is not None
        moving_s = [at_s for at_s, command in self.sent if command != STANDSTILL]
        assert self.sent[-1][1] == STANDSTILL
        return min(at_s for at_s, _ in self.sent if at_s > moving_s[-1]) - self.fault_s


DRIVES = {
    "waypoint": Waypoint(1.0, 0.3),
    "move": Move(0.8, 0.9),
    "trajectory": Trajectory(((0.4, 0.0), (0.8, 0.2), (1.2, 0.4))),
    "velocity": Velocity(0.2, 0.2, 3.0),
}
MOVEMENTS = ["Forward", "Left", *DRIVES]


@dataclass(frozen=True)
class Fault:
    """A fault, the reason of the end, and the limit for zero velocity."""

    cause: Callable[[VirtualBase], None]
    says: str
    zeroed_s: float = AT_ONCE_S
    sensor_lost: bool = False


def setting(name: str, value: object = True) -> Callable[[VirtualBase], None]:
    return lambda base: setattr(base, name, value)


def hazard(which: Hazard) -> Callable[[VirtualBase], None]:
    return lambda base: base.mover.take_hazard(which, 0, True, "left")


FAULTS = {
    "bumper": Fault(hazard(Hazard.BUMPER), "bumper"),
    "cliff": Fault(hazard(Hazard.CLIFF), "cliff"),
    "wheel drop": Fault(hazard(Hazard.WHEEL_DROP), "wheel drop"),
    "nan": Fault(setting("is_nan"), "odometry is not finite", sensor_lost=True),
    "jump": Fault(setting("jump_m", 1.5), "odometry jumped 1.5", sensor_lost=True),
    "rival": Fault(lambda base: base.mover.take_rival("/joystick commands /cmd_vel as well"), "/joystick"),
    "caller gone": Fault(setting("caller_is_gone"), "the caller has disconnected"),
    "silent": Fault(setting("is_silent"), "no odometry for", SETTINGS.odometry_timeout_s + AT_ONCE_S, sensor_lost=True),
    "stuck": Fault(setting("is_stuck"), "does not follow", 1.2),
}


@pytest.fixture(autouse=True)
def base_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[VirtualBase], VirtualBase]:
    """Silence is measured by the monotonic clock; here it is the base's."""

    def follow(base: VirtualBase) -> VirtualBase:
        clock = SimpleNamespace(monotonic=lambda: base.now_s)
        monkeypatch.setattr(discrete_mover, "time", clock, raising=False)
        return base

    return follow


@pytest.mark.parametrize("movement", MOVEMENTS)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_ends_a_movement_for_its_reason_in_time(base_of_the_clock, name: str, movement: str) -> None:
    fault = FAULTS[name]
    base = base_of_the_clock(VirtualBase(fault.cause))
    outcome = base.execute(movement)
    assert outcome.answer is False
    assert fault.says in outcome.reason
    assert outcome.sensor_lost is fault.sensor_lost
    assert base.zeroed_after_s <= fault.zeroed_s + 1e-6
