"""A docked robot leaves its dock by the manufacturer's action, and does not drive before."""

from concurrent.futures import Future
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from vsnbench.errors import RobotError
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.docking import Dock, send_goal, undock
from vsnbench.ros.ros2.interface import in_namespace, ros2_interface
from vsnbench.values.robot_profile import RobotProfile


def dock_of(profile: RobotProfile) -> Dock:
    return Dock(profile, ros2_interface(profile))


def finished(message: object) -> "Future[object]":
    future: Future[object] = Future()
    future.set_result(message)
    return future


@dataclass
class Server:
    """An action client and the handle of its goal."""

    accepted: bool = True
    status: int = 4
    is_docked: bool = False
    silent: bool = False
    cancelled: list[bool] = field(default_factory=list)

    def send_goal_async(self, goal: object) -> "Future[object]":
        return finished(self)

    def get_result_async(self) -> "Future[object]":
        result = SimpleNamespace(is_docked=self.is_docked)
        return Future() if self.silent else finished(SimpleNamespace(status=self.status, result=result))

    def cancel_goal_async(self) -> "Future[object]":
        self.cancelled.append(True)
        return finished(None)


def test_a_base_that_leaves_its_dock_is_not_an_error() -> None:
    send_goal(Server(), None, "/undock")


@pytest.mark.parametrize(
    ("server", "code"),
    [
        (Server(accepted=False), "undock-refused"),
        (Server(status=6), "undock-failed"),
        (Server(is_docked=True), "undock-failed"),
    ],
)
def test_a_base_that_does_not_leave_its_dock_is_an_error(server: Server, code: str) -> None:
    with pytest.raises(RobotError) as error:
        send_goal(server, None, "/undock")
    assert error.value.code == code


def test_the_goal_is_cancelled_after_the_timeout() -> None:
    server = Server(silent=True)
    with pytest.raises(RobotError) as error:
        send_goal(server, None, "/undock", timeout_s=0.01)
    assert error.value.code == "no-answer"
    assert server.cancelled


def test_without_the_message_package_the_advice_is_the_command_for_the_robot() -> None:
    with pytest.raises(RobotError) as refused:
        undock(None, ros2_interface(in_namespace(load_profile("turtlebot4"), "robot1")))
    assert refused.value.code == "no-irobot-create-msgs"
    assert "ros2 action send_goal /robot1/undock irobot_create_msgs/action/Undock '{}'" in str(refused.value)
    with pytest.raises(RobotError) as refused:
        undock(None, ros2_interface(load_profile("stretch")))
    assert refused.value.code == "no-undock-action"


def test_a_dock_is_a_fault_once_the_base_reports_it() -> None:
    dock = dock_of(load_profile("turtlebot4"))
    assert (dock.fault, dock.doubt) == (None, "")
    dock.take_battery(SimpleNamespace(power_supply_status=1))
    assert dock.doubt
    dock.take_status(SimpleNamespace(is_docked=True))
    assert "vsnbench robots undock turtlebot4, or push it off by hand" in str(dock.fault)
    dock.take_status(SimpleNamespace(is_docked=False))
    assert (dock.fault, dock.doubt) == (None, "")
    assert dock_of(in_namespace(load_profile("create3"), "b")).advice.startswith("vsnbench robots undock create3@b")
    assert dock_of(load_profile("stretch")).advice == "push it off by hand"


def test_an_interrupt_cancels_a_goal_that_is_accepted_later() -> None:
    server, answer, waited = Server(), Future(), []

    class Interrupted(Future):
        """An answer that arrives after the interrupt."""

        def add_done_callback(self, call) -> None:
            waited.append(call)
            if len(waited) == 1:
                raise KeyboardInterrupt
            answer.add_done_callback(call)
            answer.set_result(server)

        def result(self, timeout=None):
            return answer.result(timeout)

    with pytest.raises(KeyboardInterrupt):
        send_goal(SimpleNamespace(send_goal_async=lambda _goal: Interrupted()), None, "/undock")
    assert server.cancelled
