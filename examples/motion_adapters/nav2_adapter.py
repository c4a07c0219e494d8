"""A motion adapter for Nav2: movements as the actions FollowPath, NavigateToPose, Spin and BackUp.

    python ros2_adapter.py nav2_adapter:Nav2    # needs a sourced ROS 2 with nav2_msgs, and the odometry on /odom

| movement | action |
| --- | --- |
| `move`: turn, then straight | spin, then follow_path along a line; backup for a negative distance |
| `waypoint` | navigate_to_pose, which plans around obstacles that its costmaps know |
| `trajectory` | follow_path |
| `velocity` | refused |

Written for nav2_msgs 1.3 and 1.4 (Jazzy, Kilted). Nav2 calls a goal reached within `xy_goal_tolerance`, 0.25 m unless
you set it: set 0.05 m in its goal checker, and `tolerances: {position_m: 0.05, turn_deg: 3}` in the profile.
"""

import math
import time
from collections.abc import Iterator

SUCCEEDED, CANCELED = 4, 5  # action_msgs/GoalStatus
WORDS = {
    **dict.fromkeys((102, 702, 712, 9002), "sensor"),  # TF_ERROR
    **dict.fromkeys((104, 105, 106, 703, 714), "blocked"),  # no progress, no valid control, collision ahead
    **dict.fromkeys((107, 701, 711, 9003), "deadline"),
}
"""Refusal by the error code of a result (nav2_msgs/action); others are faults."""
REST_S, STEP_M, SPEED_M_S = 0.3, 0.05, 0.2


class Nav2:
    """Executes movements as goals of Nav2: the robot of ros2_adapter.py.

    Args:
        node: the node of the adapter.
        clients: ActionClients of follow_path, navigate_to_pose, spin and backup by name; default: those of the node.
        types: the message classes that their goals need, by name.
        frame: frame of the odometry, which Nav2 transforms into its map.
    """

    card = {"name": "nav2", "version": "1", "movements": ["move", "waypoint", "trajectory"]}  # noqa: RUF012

    def __init__(self, node, clients: dict | None = None, types: dict | None = None, frame: str = "odom") -> None:
        self.pose, self._handle, self._frame = None, None, frame
        self._clients, self._types = (clients, types) if clients else self._connected(node)

    @property
    def now_s(self) -> float:
        return time.monotonic()

    @property
    def missing(self) -> str:
        silent = [name for name, client in self._clients.items() if not client.server_is_ready()]
        return f"no action server {silent[0]}" if silent else "" if self.pose else "no odometry received yet"

    def execute(self, movement: dict, deadline_s: float) -> Iterator[None]:
        """Execute a movement, which is done when the odometry is at rest; return the keys of `done`."""
        if self.pose is None:
            return {"completed": False, "refusal": "sensor", "failure": self.missing}
        give_up_s = self.now_s + deadline_s
        try:
            for name, goal in self._goals(movement, self.pose):
                refused = yield from self._run(name, goal, give_up_s)
                yield from self._at_rest()
                if refused:
                    return refused
        except ValueError as error:
            return {"completed": False, "refusal": "unsupported", "failure": str(error)}
        finally:
            self.stop()
        return {"completed": True}

    def stop(self) -> None:
        """Cancel the running goal: the controller then commands zero velocity."""
        if self._handle is not None:
            self._handle.cancel_goal_async()
            self._handle = None

    def _run(self, name: str, goal: object, give_up_s: float) -> Iterator[None]:
        """Run one action; return the answer if the movement ends with it."""
        sent = self._clients[name].send_goal_async(goal)
        while not sent.done():
            yield
        self._handle = sent.result()
        if not self._handle.accepted:
            self._handle = None
            return {"completed": False, "refusal": "fault", "failure": f"{name} has rejected the goal"}
        ended, is_late = self._handle.get_result_async(), False
        while not ended.done():
            if not is_late and self.now_s > give_up_s:
                is_late = True
                self.stop()
            yield
        self._handle, response = None, ended.result()
        if is_late:
            return {"completed": False, "refusal": "deadline", "failure": f"{name} took too long"}
        if response.status == SUCCEEDED:
            return None
        code, text = response.result.error_code, getattr(response.result, "error_msg", "")
        if response.status == CANCELED or code == 0:  # another client's goal ends this one with an empty result
            return {"completed": False, "refusal": "rival", "failure": f"another client ended the goal of {name}"}
        refusal = WORDS.get(code, "fault")
        return {"completed": False, "refusal": refusal, "failure": f"{name}: {text or 'error'} ({code})"}

    def _at_rest(self) -> Iterator[None]:
        """Wait until the odometry repeats."""
        give_up_s = self.now_s + 2.0
        while self.now_s < give_up_s:
            before, until_s = self.pose, self.now_s + REST_S
            while self.now_s < until_s:
                yield
            turned = math.remainder(self.pose[2] - before[2], math.tau)
            if math.dist(before[:2], self.pose[:2]) < 0.002 and abs(turned) < 0.005:
                return

    def _goals(self, movement: dict, start: tuple[float, float, float]) -> list[tuple[str, object]]:
        """Return the actions of a movement with their goals."""
        match movement["kind"]:
            case "move":
                turn_rad, way_m = movement.get("turn_rad", 0.0), movement.get("distance_m", 0.0)
                goals = [("spin", self._types["Spin"](target_yaw=turn_rad))] if turn_rad else []
                if way_m < 0:
                    target = self._types["Point"](x=way_m)
                    goals.append(("backup", self._types["BackUp"](target=target, speed=SPEED_M_S)))
                elif way_m > 0:
                    x, y, heading = start
                    goals.append(("follow_path", self._path((x, y, heading + turn_rad), [(way_m, 0.0)])))
                return goals
            case "waypoint":
                x_m, y_m = movement["x_m"], movement["y_m"]
                heading = movement.get("heading_rad")
                pose = _placed(start, x_m, y_m, math.atan2(y_m, x_m) if heading is None else heading)
                return [("navigate_to_pose", self._types["NavigateToPose"](pose=self._stamped(pose)))]
            case "trajectory":
                return [("follow_path", self._path(start, movement["points"]))]
        raise ValueError(f"Nav2 has no action for {movement['kind']}")

    def _path(self, start: tuple[float, float, float], points: list) -> object:
        """Return the goal of follow_path along a polyline, with a pose every 5 cm as planners give them."""
        path = self._types["Path"]()
        path.header.frame_id = self._frame
        last = (0.0, 0.0)
        for point in points:
            length_m, heading = math.dist(last, point), math.atan2(point[1] - last[1], point[0] - last[0])
            count = max(1, math.ceil(length_m / STEP_M))
            for share in (number / count for number in range(count + 1)):
                x, y = (a + share * (b - a) for a, b in zip(last, point, strict=True))
                path.poses.append(self._stamped(_placed(start, x, y, heading)))
            last = tuple(point)
        return self._types["FollowPath"](path=path)

    def _stamped(self, pose: tuple[float, float, float]) -> object:
        """Return a PoseStamped; its stamp of zero asks TF for the newest transform."""
        message = self._types["PoseStamped"]()
        message.header.frame_id = self._frame
        message.pose.position.x, message.pose.position.y = pose[0], pose[1]
        message.pose.orientation.z, message.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        return message

    def _connected(self, node) -> tuple[dict, dict]:
        """Subscribe to the odometry; return the clients of Nav2's actions and the classes of their goals."""
        from geometry_msgs.msg import Point, PoseStamped
        from nav2_msgs.action import BackUp, FollowPath, NavigateToPose, Spin
        from nav_msgs.msg import Odometry, Path
        from rclpy.action import ActionClient
        from rclpy.qos import qos_profile_sensor_data

        node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)
        actions = {"follow_path": FollowPath, "navigate_to_pose": NavigateToPose, "spin": Spin, "backup": BackUp}
        goals = {kind.__name__: kind.Goal for kind in actions.values()}
        clients = {name: ActionClient(node, kind, name) for name, kind in actions.items()}
        return clients, {**goals, "Point": Point, "PoseStamped": PoseStamped, "Path": Path}

    def _on_odometry(self, message) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        self.pose = at.x, at.y, heading


def _placed(start: tuple[float, float, float], x_m: float, y_m: float, heading: float) -> tuple[float, float, float]:
    """Return a pose of the robot's frame at the start in the frame of the odometry."""
    cos, sin = math.cos(start[2]), math.sin(start[2])
    return start[0] + cos * x_m - sin * y_m, start[1] + sin * x_m + cos * y_m, start[2] + heading
