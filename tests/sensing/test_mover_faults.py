"""Faults during every movement, in virtual time: the reason of the end, and when zero velocity is commanded.

The limits hold for the rules of the mover alone. Over ROS, the transport of messages and a busy machine add to them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from tests.movements import FORWARD, LEFT
from tests.sensing.stand import SETTINGS, Stand
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.sensing.hazards import Hazard
from vsnbench.values.movement import Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

RATE_HZ = 50.0
FAULT_S = 1.0
AT_ONCE_S = 2 * SETTINGS.control_period_s + 1 / RATE_HZ
"""The fault arrives with a message, and the next control period acts on it."""


@dataclass
class FaultyStand(Stand):
    """A stand with one fault, after a second of driving."""

    fault: Callable[["FaultyStand"], None] = lambda _: None
    is_silent: bool = False
    is_stuck: bool = False
    is_nan: bool = False
    jump_m: float = 0.0
    caller_is_gone: bool = False
    fault_s: float | None = None
    sent: list[tuple[float, Command]] = field(default_factory=list)
    _driven_s: float = 0.0

    def hear(self, command: Command) -> None:
        now_s = self.base.now_s
        if self.sent and self.sent[-1][1] != STANDSTILL:
            self._driven_s += now_s - self.sent[-1][0]
        self.sent.append((now_s, command))
        if self._driven_s >= FAULT_S and self.fault_s is None:
            self.fault_s = now_s
            self.fault(self)
        super().hear(STANDSTILL if self.is_stuck else command)

    def report(self, pose: Pose) -> None:
        if not self.is_silent:
            super().report(Pose(pose.x_m + self.jump_m, pose.y_m, pose.heading_rad))
        if self.is_nan:
            self.mover.take_odometry(math.nan, pose.y_m, 0.0, self.base.now_s)

    @property
    def zeroed_after_s(self) -> float:
        """Time from the fault to the first of the zero velocities for good."""
        assert self.fault_s is not None
        moving_s = [at_s for at_s, command in self.sent if command != STANDSTILL]
        assert self.sent[-1][1] == STANDSTILL
        return min(at_s for at_s, _ in self.sent if at_s > moving_s[-1]) - self.fault_s


MOVEMENTS = {
    "forward": FORWARD,
    "turn": LEFT,
    "waypoint": Waypoint(1.0, 0.3),
    "move": Move(0.8, 0.9),
    "trajectory": Trajectory(((0.4, 0.0), (0.8, 0.2), (1.2, 0.4))),
    "velocity": Velocity(0.2, 0.2, 3.0),
}


@dataclass(frozen=True)
class Fault:
    """A fault, the reason of the end, and the limit for zero velocity."""

    cause: Callable[[FaultyStand], None]
    says: str
    zeroed_s: float = AT_ONCE_S
    sensor_lost: bool = False


def setting(name: str, value: object = True) -> Callable[[FaultyStand], None]:
    return lambda base: setattr(base, name, value)


def hazard(which: Hazard) -> Callable[[FaultyStand], None]:
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


@pytest.mark.parametrize("movement", MOVEMENTS)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_ends_a_movement_for_its_reason_in_time(name: str, movement: str) -> None:
    fault = FAULTS[name]
    base = FaultyStand(fault=fault.cause)
    result = base.mover.drive(MOVEMENTS[movement], lambda: base.caller_is_gone)
    assert result.completed is False
    assert fault.says in result.failure
    assert result.sensor_lost is fault.sensor_lost
    assert base.zeroed_after_s <= fault.zeroed_s + 1e-6
