"""A discrete_move node answers False after it was closed, and stops for another publisher."""

from types import SimpleNamespace

import pytest

from tests.movements import FORWARD
from tests.sensing.stand import LEGGED
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.common.discrete_move import DiscreteMoveTask, mover_of
from vsnbench.ros.common.messages import fill_twist
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.values.robot_profile import RobotProfile

PROFILE = load_profile("turtlebot2")


class Task(DiscreteMoveTask):
    """A task that records its velocities, with a clock that passes while it sleeps."""

    def __init__(self, profile: RobotProfile = PROFILE) -> None:
        self.sent: list[Command] = []
        self.now_s = 0.0
        mover = mover_of(profile, MotionSettings.for_robot(profile), self.send, lambda: self.now_s, self.sleep_until)
        super().__init__(ros1_interface(profile), mover)

    def send(self, command: Command) -> None:
        self.sent.append(command)

    def sleep_until(self, due_s: float) -> None:
        self.now_s = due_s
        self.take_odometry((0.0, 0.0, 0.0), due_s, "/base")
        if self.now_s > 1.0:
            twist = SimpleNamespace(linear=SimpleNamespace(x=0.2, y=0.0), angular=SimpleNamespace(z=0.0))
            self.take_foreign_command(twist, "/joystick")


class HolonomicBase(Task):
    """A task whose base follows the fields of each Twist at once."""

    x_m = y_m = 0.0

    def sleep_until(self, due_s: float) -> None:
        twist = SimpleNamespace(linear=SimpleNamespace(), angular=SimpleNamespace())
        fill_twist(twist, self.sent[-1] if self.sent else STANDSTILL)
        self.x_m += twist.linear.x * (due_s - self.now_s)
        self.y_m += twist.linear.y * (due_s - self.now_s)
        self.now_s = due_s
        self.take_odometry((self.x_m, self.y_m, 0.0), due_s, "/base")


def test_a_sidestep_from_the_network_moves_a_base_to_the_side() -> None:
    task = HolonomicBase(LEGGED)
    task.sleep_until(0.1)
    result = task.drive_json({"kind": "sidestep", "left_m": -0.3}, lambda: False)
    assert result.completed, result.failure
    assert (task.x_m, task.y_m) == (pytest.approx(0.0, abs=1e-6), pytest.approx(-0.3, abs=0.005))
    assert task.sent[-1] == STANDSTILL


def test_another_publisher_ends_a_movement_at_zero_velocity() -> None:
    task = Task()
    task.take_odometry((0.0, 0.0, 0.0), 0.0, "/base")
    result = task.drive(FORWARD, lambda: False)
    assert not result.completed
    assert "/joystick" in result.failure
    assert task.sent[-1] == STANDSTILL


def test_a_closed_task_commands_zero_velocity_and_answers_false() -> None:
    task = Task()
    task.close()
    assert task.sent[-1] == STANDSTILL
    sent = len(task.sent)
    assert task.drive(FORWARD, lambda: False).completed is False
    assert len(task.sent) == sent


@pytest.mark.parametrize(
    "content",
    [
        None,
        {"kind": "fly"},
        {"kind": "velocity", "duration_s": 1e9},
        {"kind": "pixel", "u": 1, "v": 2},
        {"kind": "sidestep", "left_m": 0.3},
    ],
)
def test_a_movement_that_cannot_be_executed_is_refused_before_it_moves(content: object) -> None:
    task = Task()
    result = task.drive_json(content, lambda: False)
    assert not result.completed
    assert result.failure
    assert task.sent == []
