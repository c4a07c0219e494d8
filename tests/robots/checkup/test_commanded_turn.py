"""The turns of `doctor --move` are recorded, end at a hazard or silent odometry, and end at standstill."""

import time
from collections.abc import Sequence

import pytest

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.errors import RobotError
from vsnbench.robots.checkup.commanded_turn import SteeredBase, record_turn
from vsnbench.robots.checkup.response import response_of
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.values.pose import Pose


class Base(SteeredBase):
    """An ideal base; its bumper is pressed, or its odometry ends, when it has turned by some radians."""

    def __init__(self, *, pressed_rad: float = 9.0, silent_rad: float = 9.0) -> None:
        self.commands: list[Command] = []
        self._pressed_rad, self._silent_rad = pressed_rad, silent_rad
        self._heading_rad, self._at_s = 0.0, time.monotonic()
        self._reading = OdometryReading(Pose(0.0, 0.0), self._at_s, self._at_s)

    @property
    def now_s(self) -> float:
        return time.monotonic()

    def steer(self, command: Command) -> None:
        self._follow()
        self.commands.append(command)

    def latest(self) -> Sequence[OdometryReading]:
        self._follow()
        if self._heading_rad < self._silent_rad:
            self._reading = OdometryReading(Pose(0.0, 0.0, self._heading_rad), self._at_s, self._at_s)
        return [self._reading]

    def hazard(self) -> str:
        return "bumper" if self._heading_rad > self._pressed_rad else ""

    def _follow(self) -> None:
        now_s = time.monotonic()
        if self.commands:
            self._heading_rad += self.commands[-1].angular_rad_s * (now_s - self._at_s)
        self._at_s = now_s


def test_a_turn_is_recorded_until_the_base_is_at_rest() -> None:
    base = Base()
    turn = record_turn(base, [(0.4, 0.8)])
    assert turn.covered[-1][1] == pytest.approx(0.32, abs=0.1)
    assert turn.commands[-1][1] == 0
    assert base.commands[-1] == STANDSTILL
    response = response_of(turn)
    assert response is not None
    assert response.delay_s < 0.1


@pytest.mark.parametrize(("fault", "code"), [({"pressed_rad": 0.05}, "hazard"), ({"silent_rad": 0.05}, "no-odometry")])
def test_a_hazard_and_silent_odometry_end_a_turn_at_standstill(fault: dict[str, float], code: str) -> None:
    base = Base(**fault)
    with pytest.raises(RobotError) as ended:
        record_turn(base, [(0.4, 5.0)])
    assert ended.value.code == code
    assert base.commands[-1] == STANDSTILL
    assert base._heading_rad < 1.0
