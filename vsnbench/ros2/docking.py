"""A base on its charging dock: whether it stands there, and leaving it through the maker's own action.

`irobot_create_msgs` comes with the robot's distribution and in no wheel; without it a battery that charges is the only
hint. Of its types this reads DockStatus.is_docked, and of the action Undock the result's is_docked; the goal is empty.
"""

import contextlib
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vsnbench.errors import RobotError
from vsnbench.ros2.installation import irobot_type

if TYPE_CHECKING:
    from vsnbench.ros2.interface import Ros2Interface
    from vsnbench.ros2.node import Ros2Node

UNDOCK_S = 60.0
"""A Create 3 drives backwards off its dock and turns round; it takes some ten seconds."""
_ANSWER_S = 10.0
_TAKE_BACK_S = 3.0
_SUCCEEDED = 4
"""action_msgs/GoalStatus.STATUS_SUCCEEDED."""
_CHARGING = 1
"""sensor_msgs/BatteryState.POWER_SUPPLY_STATUS_CHARGING."""


class Dock:
    """What a base has said of its dock until now."""

    def __init__(self, profile_name: str, names: "Ros2Interface") -> None:
        robot = f"{profile_name}@{names.root.strip('/')}" if names.root else profile_name
        command = f"vsnbench ros2 undock --robot {robot}, or " if names.undock else ""
        self.advice = f"{command}push it off by hand"
        self.is_docked: bool | None = None
        """None while nothing was said, as where the type of the message is missing."""
        self.is_charging = False

    def take_status(self, message: Any) -> None:
        """Take an irobot_create_msgs/DockStatus."""
        self.is_docked = bool(message.is_docked)

    def take_battery(self, message: Any) -> None:
        """Take a sensor_msgs/BatteryState."""
        self.is_charging = message.power_supply_status == _CHARGING

    @property
    def fault(self) -> RobotError | None:
        """Why the robot must not move: it stands on its dock; None when it does not, or nobody says."""
        return RobotError("the robot stands on its dock", advice=self.advice) if self.is_docked else None

    @property
    def doubt(self) -> str:
        """Why it may stand there, where the base does not say; empty for nothing."""
        if self.is_docked is None and self.is_charging:
            return f"the battery is charging: if the robot stands on its dock, {self.advice}"
        return ""


def subscribe_dock(
    node: "Ros2Node", names: "Ros2Interface", dock: Dock, also: Callable[[Any], None] = lambda _battery: None
) -> None:
    """Tell `dock` all that the base says of it; every sensor_msgs/BatteryState goes to `also`, too."""
    from sensor_msgs.msg import BatteryState

    from vsnbench.ros2.node import SENSOR_DATA

    status = irobot_type("msg", "DockStatus")
    if names.dock and status is not None:
        node.rclpy.create_subscription(status, names.dock, dock.take_status, SENSOR_DATA)
    if names.battery:

        def on_battery(message: Any) -> None:
            dock.take_battery(message)
            also(message)

        node.rclpy.create_subscription(BatteryState, names.battery, on_battery, SENSOR_DATA)


def undock(node: "Ros2Node", names: "Ros2Interface") -> None:
    """Have the base leave its dock.

    Raises:
        RobotError: it cannot be asked, or did not leave.
    """
    if not names.undock:
        advice = "push it off by hand, or name the action in the profile (interface.undock)"
        raise RobotError("this robot has no action that undocks it", advice=advice)
    action = irobot_type("action", "Undock")
    if action is None:
        there = f"on the robot: ros2 action send_goal {names.undock} irobot_create_msgs/action/Undock '{{}}'"
        raise RobotError(
            "irobot_create_msgs is not on this machine, and no wheel has it", advice=f"{there}, or push it off by hand"
        )
    from rclpy.action import ActionClient

    client = ActionClient(node.rclpy, action, names.undock)
    try:
        if not client.wait_for_server(timeout_sec=_ANSWER_S):
            raise RobotError(f"nobody serves {names.undock}", advice="is the base on, in this domain and namespace?")
        carry_out(client, action.Goal(), names.undock)
    finally:
        client.destroy()


def carry_out(client: Any, goal: Any, name: str, timeout_s: float = UNDOCK_S) -> None:
    """Send the goal and wait until the base has left its dock; whatever ends the wait cancels the goal.

    Args:
        client: an rclpy.action.ActionClient of irobot_create_msgs/action/Undock.
        goal: what it sends.
        name: the action's name.
        timeout_s: how long the base may take.

    Raises:
        RobotError: the base refused, failed, or took too long.
    """
    asked = client.send_goal_async(goal)
    try:
        handle = _await(asked, _ANSWER_S, f"{name} does not answer")
        if not handle.accepted:
            raise RobotError(f"{name} was refused", advice="does the robot stand on its dock? if not, it is ready")
        done = _await(handle.get_result_async(), timeout_s, f"{name} has not ended after {timeout_s:.0f} s")
    except BaseException:
        _take_back(asked)
        raise
    if done.status != _SUCCEEDED or done.result.is_docked:
        raise RobotError(f"{name} failed, the base still stands on its dock", advice="push it off by hand")


def _take_back(asked: Any) -> None:
    """Cancel a goal, also one whose answer is still on its way, and see that the base has heard it."""
    with contextlib.suppress(RobotError):
        handle = _await(asked, _TAKE_BACK_S, "")
        if handle.accepted:
            _await(handle.cancel_goal_async(), _TAKE_BACK_S, "")


def _await(future: Any, timeout_s: float, otherwise: str) -> Any:
    """Return what a future brings; the node spins elsewhere."""
    came = threading.Event()
    arrived: Callable[[Any], None] = lambda _: came.set()  # noqa: E731
    future.add_done_callback(arrived)
    if not came.wait(timeout_s):
        raise RobotError(otherwise, advice="is the base still alive?")
    return future.result()
