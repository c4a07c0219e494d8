"""The charging dock of a base: its state, and undocking by the manufacturer's action.

Needs `irobot_create_msgs`, which only a distribution has; without it a charging battery is the only hint. Used fields:
DockStatus.is_docked, and is_docked in the result of the action Undock, whose goal is empty.
"""

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vsnbench.errors import RobotError
from vsnbench.ros.common.node import result_of
from vsnbench.ros.ros2.installation import irobot_type

if TYPE_CHECKING:
    from vsnbench.ros.ros2.interface import Ros2Interface
    from vsnbench.ros.ros2.node import Ros2Node
    from vsnbench.values.robot_profile import RobotProfile

UNDOCK_S = 60.0
"""A Create 3 drives backwards off its dock and turns round in about ten seconds."""
_ANSWER_S = 10.0
_CANCEL_S = 3.0
_SUCCEEDED = 4
"""action_msgs/GoalStatus.STATUS_SUCCEEDED."""
_CHARGING = 1
"""sensor_msgs/BatteryState.POWER_SUPPLY_STATUS_CHARGING."""


class Dock:
    """State of the dock, as far as the base has reported it."""

    def __init__(self, profile: "RobotProfile", names: "Ros2Interface") -> None:
        command = f"vsnbench robots undock {profile.argument}, or " if names.undock else ""
        self.advice = f"{command}push it off by hand"
        self.is_docked: bool | None = None
        """None before the first report, or if the message type is not installed."""
        self.is_charging = False

    def take_status(self, message: Any) -> None:
        """Take an irobot_create_msgs/DockStatus."""
        self.is_docked = bool(message.is_docked)

    def take_battery(self, message: Any) -> None:
        """Take a sensor_msgs/BatteryState."""
        self.is_charging = message.power_supply_status == _CHARGING

    @property
    def fault(self) -> RobotError | None:
        """The fault of a docked robot; None if it is not docked or the state is unknown."""
        return RobotError("the robot is on its dock", advice=self.advice, code="docked") if self.is_docked else None

    @property
    def doubt(self) -> str:
        """Hint that the robot may be docked where the base does not report it, or an empty string."""
        if self.is_docked is None and self.is_charging:
            return f"the battery is charging: if the robot is on its dock, {self.advice}"
        return ""


def subscribe_dock(
    node: "Ros2Node", names: "Ros2Interface", dock: Dock, take_battery: Callable[[Any], None] = lambda _battery: None
) -> None:
    """Pass reports of the dock to `dock`, and every sensor_msgs/BatteryState to `take_battery` too."""
    from sensor_msgs.msg import BatteryState

    from vsnbench.ros.ros2.node import SENSOR_DATA

    status = irobot_type("msg", "DockStatus")
    if names.dock and status is not None:
        node.rclpy.create_subscription(status, names.dock, dock.take_status, SENSOR_DATA)
    if names.battery:

        def on_battery(message: Any) -> None:
            dock.take_battery(message)
            take_battery(message)

        node.rclpy.create_subscription(BatteryState, names.battery, on_battery, SENSOR_DATA)


def undock(node: "Ros2Node", names: "Ros2Interface") -> None:
    """Make the base leave its dock.

    Raises:
        RobotError: the base has no such action, or it failed.
    """
    if not names.undock:
        advice = "push it off by hand, or name the action in the profile (interface.undock)"
        raise RobotError("this robot has no undock action", advice=advice, code="no-undock-action")
    action = irobot_type("action", "Undock")
    if action is None:
        on_robot = f"run on the robot: ros2 action send_goal {names.undock} irobot_create_msgs/action/Undock '{{}}'"
        raise RobotError(
            "irobot_create_msgs is not installed, and no wheel has it",
            advice=f"{on_robot}, or push it off by hand",
            code="no-irobot-create-msgs",
        )
    client = node.action_client(action, names.undock)
    try:
        if not client.wait_for_server(timeout_sec=_ANSWER_S):
            raise RobotError(
                f"no node offers {names.undock}",
                advice="switch the base on, and check domain and namespace",
                code="no-undock-server",
            )
        send_goal(client, action.Goal(), names.undock)
    finally:
        client.destroy()


def send_goal(client: Any, goal: Any, name: str, timeout_s: float = UNDOCK_S) -> None:
    """Send the goal and wait until the base has left its dock; an exception cancels the goal.

    Args:
        client: rclpy.action.ActionClient of irobot_create_msgs/action/Undock.
        goal: goal of the action.
        name: name of the action.
        timeout_s: longest duration of the action.

    Raises:
        RobotError: the base refused, failed, or did not finish in time.
    """
    sent = client.send_goal_async(goal)
    try:
        handle = _await(sent, _ANSWER_S, f"{name} does not answer")
        if not handle.accepted:
            raise RobotError(
                f"the base refused {name}",
                advice="check that the robot is on its dock; if not, it is ready",
                code="undock-refused",
            )
        done = _await(handle.get_result_async(), timeout_s, f"{name} has not finished after {timeout_s:.0f} s")
    except BaseException:
        _cancel(sent)
        raise
    if done.status != _SUCCEEDED or done.result.is_docked:
        raise RobotError(
            f"{name} failed: the base is still on its dock", advice="push it off by hand", code="undock-failed"
        )


def _cancel(sent: Any) -> None:
    """Cancel a goal, also one that the base has not accepted yet, and wait for the confirmation."""
    with contextlib.suppress(RobotError):
        handle = _await(sent, _CANCEL_S, "")
        if handle.accepted:
            _await(handle.cancel_goal_async(), _CANCEL_S, "")


def _await(future: Any, timeout_s: float, otherwise: str) -> Any:
    try:
        return result_of(future, timeout_s)
    except TimeoutError as error:
        raise RobotError(otherwise, advice="check that the base is alive", code="no-answer") from error
