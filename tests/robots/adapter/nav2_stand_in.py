"""Action servers that behave as those of Nav2.

From navigation2, branch kilted (71a1d84): `controller_server.cpp` ends a cancelled goal at once and commands zero
velocity; a goal is reached within `xy_goal_tolerance` (`simple_goal_checker.cpp`); `simple_action_server.hpp` aborts
the goal that another one pre-empts with an empty result; exceptions of a controller abort it with an error code.
`spin.cpp` and `back_up.cpp` execute relative motions in the frame of the robot, backwards whatever the sign.
"""

import math
from types import SimpleNamespace
from typing import Any

from vsnbench.values.pose import Pose

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
TOLERANCE_M = 0.04
STEPS = 5
"""Polls of a result until a goal has ended."""


class Message(SimpleNamespace):
    """A message whose fields are made when they are read."""

    def __getattr__(self, name: str) -> Any:
        made = [] if name == "poses" else Message()
        setattr(self, name, made)
        return made


TYPES = dict.fromkeys(("Spin", "BackUp", "FollowPath", "NavigateToPose", "Point", "PoseStamped", "Path"), Message)


class Done:
    """A future that is done after some polls."""

    def __init__(self, polls: int, result: Any) -> None:
        self._left, self._result = polls, result

    def done(self) -> bool:
        self._left -= 1
        return self._left < 0

    def result(self) -> Any:
        return self._result() if callable(self._result) else self._result


class Nav2StandIn:
    """A robot in the frame `odom`, and the servers that move it."""

    def __init__(self) -> None:
        self.at = Pose(1.0, 2.0, 0.5)
        self.goals: list[tuple[str, Any]] = []
        self.accepts = True
        self.error: tuple[int, str] | None = None
        self.preempted = False
        self.never_ends = False
        self.cancelled = 0
        self.clients = {name: _Client(self, name) for name in ("follow_path", "navigate_to_pose", "spin", "backup")}

    def pose(self) -> tuple[float, float, float]:
        return self.at.x_m, self.at.y_m, self.at.heading_rad

    def end(self, name: str, goal: Any) -> None:
        """Move the robot to the end of a goal, within the tolerance."""
        if name == "spin":
            self.at = self.at.compose(Pose(0.0, 0.0, goal.target_yaw))
        elif name == "backup":
            self.at = self.at.compose(Pose(-abs(goal.target.x), 0.0))
        else:
            last = goal.pose if name == "navigate_to_pose" else goal.path.poses[-1]
            heading = 2 * math.atan2(last.pose.orientation.z, last.pose.orientation.w)
            self.at = Pose(last.pose.position.x - TOLERANCE_M, last.pose.position.y, heading)


class _Client:
    """The client of one action."""

    def __init__(self, nav2: Nav2StandIn, name: str) -> None:
        self._nav2, self._name = nav2, name

    def server_is_ready(self) -> bool:
        return self._nav2.accepts

    def send_goal_async(self, goal: Any) -> Done:
        self._nav2.goals.append((self._name, goal))
        return Done(1, _Handle(self._nav2, self._name, goal))


class _Handle:
    """The handle of one goal."""

    def __init__(self, nav2: Nav2StandIn, name: str, goal: Any) -> None:
        self._nav2, self._name, self._goal = nav2, name, goal
        self.accepted = nav2.accepts
        self._cancelled = False

    def cancel_goal_async(self) -> None:
        self._cancelled = True
        self._nav2.cancelled += 1
        self._ended._left = 0

    def get_result_async(self) -> Done:
        self._ended = Done(10**6 if self._nav2.never_ends else STEPS, self._response)
        return self._ended

    def _response(self) -> Any:
        nav2 = self._nav2
        if self._cancelled:
            return SimpleNamespace(status=CANCELED, result=SimpleNamespace(error_code=0, error_msg=""))
        if nav2.preempted:
            return SimpleNamespace(status=ABORTED, result=SimpleNamespace(error_code=0, error_msg=""))
        if nav2.error is not None:
            code, text = nav2.error
            return SimpleNamespace(status=ABORTED, result=SimpleNamespace(error_code=code, error_msg=text))
        nav2.end(self._name, self._goal)
        return SimpleNamespace(status=SUCCEEDED, result=SimpleNamespace(error_code=0, error_msg=""))
