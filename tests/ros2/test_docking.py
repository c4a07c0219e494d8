"""A robot on its dock is told to leave it, by the maker's action, and does not drive before."""

from concurrent.futures import Future
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.profiles import load_profile
from vsnbench.ros2.docking import Dock, carry_out, undock
from vsnbench.ros2.interface import in_namespace, ros2_interface


def dock_of(profile: RobotProfile) -> Dock:
    return Dock(profile.name, ros2_interface(profile))


def said(message: object) -> "Future[object]":
    future: Future[object] = Future()
    future.set_result(message)
    return future


@dataclass
class Server:
    """What rclpy's action client is to its caller: `send_goal_async`, then a handle with a result to come."""

    accepted: bool = True
    status: int = 4
    is_docked: bool = False
    silent: bool = False
    cancelled: list[bool] = field(default_factory=list)

    def send_goal_async(self, goal: object) -> "Future[object]":
        return said(self)

    def get_result_async(self) -> "Future[object]":
        result = SimpleNamespace(is_docked=self.is_docked)
        return Future() if self.silent else said(SimpleNamespace(status=self.status, result=result))

    def cancel_goal_async(self) -> "Future[object]":
        self.cancelled.append(True)
        return said(None)


def test_a_base_that_leaves_its_dock_is_no_error() -> None:
    carry_out(Server(), None, "/undock")


@pytest.mark.parametrize(
    ("server", "words"),
    [
        (Server(accepted=False), "/undock was refused"),
        (Server(status=6), "/undock failed, the base still stands on its dock"),
        (Server(is_docked=True), "/undock failed, the base still stands on its dock"),
    ],
)
def test_a_base_that_does_not_leave_is_named(server: Server, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        carry_out(server, None, "/undock")


def test_a_base_that_takes_too_long_is_told_to_stop() -> None:
    server = Server(silent=True)
    with pytest.raises(RobotError, match="has not ended after 0 s"):
        carry_out(server, None, "/undock", timeout_s=0.01)
    assert server.cancelled


def test_without_the_makers_messages_the_command_for_the_robot_is_said() -> None:
    with pytest.raises(RobotError) as refused:
        undock(None, ros2_interface(in_namespace(load_profile("turtlebot4"), "robot1")))
    assert "irobot_create_msgs is not on this machine" in str(refused.value)
    assert "ros2 action send_goal /robot1/undock irobot_create_msgs/action/Undock '{}'" in str(refused.value)
    with pytest.raises(RobotError, match="this robot has no action that undocks it"):
        undock(None, ros2_interface(load_profile("stretch")))


def test_a_dock_is_no_fault_until_somebody_says_that_the_robot_stands_on_it() -> None:
    dock = dock_of(load_profile("turtlebot4"))
    assert (dock.fault, dock.doubt) == (None, "")
    dock.take_battery(SimpleNamespace(power_supply_status=1))
    assert "the battery is charging" in dock.doubt
    dock.take_status(SimpleNamespace(is_docked=True))
    assert "vsnbench ros2 undock --robot turtlebot4, or push it off by hand" in str(dock.fault)
    dock.take_status(SimpleNamespace(is_docked=False))
    assert (dock.fault, dock.doubt) == (None, "")
    assert dock_of(in_namespace(load_profile("create3"), "b")).advice.startswith(
        "vsnbench ros2 undock --robot create3@b"
    )
    assert dock_of(load_profile("stretch")).advice == "push it off by hand"


def test_what_is_interrupted_before_the_base_has_answered_is_taken_back_when_it_does() -> None:
    server, answer, waited = Server(), Future(), []

    class Interrupted(Future):
        """An answer that comes after the interrupt."""

        def add_done_callback(self, call) -> None:
            waited.append(call)
            if len(waited) == 1:
                raise KeyboardInterrupt
            answer.add_done_callback(call)
            answer.set_result(server)

        def result(self, timeout=None):
            return answer.result(timeout)

    with pytest.raises(KeyboardInterrupt):
        carry_out(SimpleNamespace(send_goal_async=lambda _goal: Interrupted()), None, "/undock")
    assert server.cancelled
