"""The action servers of Nav2 that move a robot, with its rules for goals, and a robot that follows `cmd_vel`.

From navigation2, branch kilted (71a1d84): `nav2_util/simple_action_server.hpp` (a new goal of `follow_path` or
`navigate_to_pose` replaces the running one, which is aborted with an empty result), `nav2_controller` (every end
commands zero velocity; a path is done within `xy_goal_tolerance`; `FAILED_TO_MAKE_PROGRESS`),
`nav2_behaviors` (`spin.cpp`, `back_up.cpp`, `drive_on_heading.hpp`, at 10 Hz: the end is looked at once in a cycle, so
that a turn overshoots; they abort at a new goal instead of replacing the running one). Its planner
knows no map and plans straight lines. With `--stuck-after M` a robot on a path makes no progress after M metres.
"""

import argparse
import contextlib
import math
import threading
import time

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav2_msgs.action import BackUp, FollowPath, NavigateToPose, Spin
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.qos import qos_profile_sensor_data

words = argparse.ArgumentParser()
words.add_argument("--stuck-after", type=float, default=math.inf)
given = words.parse_args()

XY_GOAL_TOLERANCE, YAW_GOAL_TOLERANCE = 0.04, 0.03
CONTROLLER_HZ, CYCLE_HZ = 20.0, 10.0
MOVEMENT_TIME_ALLOWANCE_S, REQUIRED_MOVEMENT_M = 2.0, 0.05
MIN_ROTATIONAL_VEL, MAX_ROTATIONAL_VEL, ROTATIONAL_ACC_LIM = 0.1, 0.8, 0.5
DECELERATION_LIMIT, MINIMUM_SPEED = 0.5, 0.03
Pose = tuple[float, float, float]


class GoalError(Exception):
    """A goal that cannot be reached: error code and text."""


class Robot:
    """The base: its odometry, and velocities for it."""

    def __init__(self, node) -> None:
        self.node, self.pose, self._arrived = node, (0.0, 0.0, 0.0), threading.Event()
        kinds = {"geometry_msgs/msg/Twist": Twist, "geometry_msgs/msg/TwistStamped": TwistStamped}
        self._kind = None
        while self._kind is None:
            found = [info.topic_type for info in node.get_subscriptions_info_by_topic("cmd_vel")]
            self._kind = next((kinds[kind] for kind in found if kind in kinds), None)
            time.sleep(0.1)
        self._publisher = node.create_publisher(self._kind, "cmd_vel", 10)
        node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)

    def _on_odometry(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        self.pose = at.x, at.y, 2 * math.atan2(turn.z, turn.w)
        self._arrived.set()

    def send(self, forward_m_s: float, turn_rad_s: float) -> None:
        message = self._kind()
        twist = message.twist if self._kind is TwistStamped else message
        twist.linear.x, twist.angular.z = forward_m_s, turn_rad_s
        self._publisher.publish(message)


class Server:
    """One action server: executes its newest goal."""

    def __init__(self, robot: Robot, kind, name: str, steps, hz: float, *, replaces: bool) -> None:
        self._robot, self._kind, self._steps, self._hz, self._replaces = robot, kind, steps, hz, replaces
        self._newest, self._runs = None, threading.Lock()
        self._server = ActionServer(
            robot.node,
            kind,
            name,
            self._execute,
            handle_accepted_callback=self._accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _accepted(self, handle) -> None:
        self._newest = handle
        print("accepted", flush=True)
        handle.execute()

    def _execute(self, handle):
        result = self._kind.Result()
        with self._runs:  # the running goal sees that there is a newer one
            if not self._replaces and self._newest is not handle:
                handle.abort()
                return result
            try:
                for forward_m_s, turn_rad_s in self._steps(self._robot, handle.request):
                    if handle.is_cancel_requested:
                        handle.canceled()
                        break
                    if self._newest is not handle:
                        handle.abort()
                        break
                    self._robot.send(forward_m_s, turn_rad_s)
                    time.sleep(1 / self._hz)
                else:
                    handle.succeed()
            except GoalError as error:
                result.error_code, result.error_msg = error.args
                handle.abort()
            finally:
                self._robot.send(0.0, 0.0)
        return result


def follow(robot: Robot, poses: list[Pose]):
    """Yield velocities along a path, then turn to the heading of its last pose."""
    begin = moved_from = robot.pose
    moved_s = time.monotonic()
    x_end, y_end, heading_end = poses[-1]
    while math.dist(robot.pose[:2], (x_end, y_end)) > XY_GOAL_TOLERANCE:
        x, y, heading = robot.pose
        if math.dist((x, y), moved_from[:2]) > REQUIRED_MOVEMENT_M or abs(heading - moved_from[2]) > 0.1:
            moved_from, moved_s = robot.pose, time.monotonic()
        if time.monotonic() - moved_s > MOVEMENT_TIME_ALLOWANCE_S:
            raise GoalError(FollowPath.Result.FAILED_TO_MAKE_PROGRESS, "Failed to make progress")
        nearest = min(range(len(poses)), key=lambda i: math.dist(poses[i][:2], (x, y)))
        ahead = next((p for p in poses[nearest:] if math.dist(p[:2], (x, y)) > 0.2), poses[-1])
        off = math.remainder(math.atan2(ahead[1] - y, ahead[0] - x) - heading, math.tau)
        if abs(off) > 0.5:
            yield 0.0, math.copysign(0.5, off)
        elif math.dist((x, y), begin[:2]) > given.stuck_after:
            yield 0.0, 0.0
        else:
            yield max(0.05, min(0.25, 0.8 * math.dist((x, y), (x_end, y_end)))), 1.5 * off
    while abs(off := math.remainder(heading_end - robot.pose[2], math.tau)) > YAW_GOAL_TOLERANCE:
        yield 0.0, math.copysign(max(0.1, min(0.5, abs(off))), off)


def pose_of(message) -> Pose:
    if message.header.frame_id not in ("odom", ""):
        raise GoalError(FollowPath.Result.TF_ERROR, f"no transform from {message.header.frame_id}")
    at, turn = message.pose.position, message.pose.orientation
    return at.x, at.y, 2 * math.atan2(turn.z, turn.w)


def follow_path(robot: Robot, goal):
    if not goal.path.poses:
        raise GoalError(FollowPath.Result.INVALID_PATH, "Path is empty.")
    return follow(robot, [pose_of(pose) for pose in goal.path.poses])


def navigate_to_pose(robot: Robot, goal):
    (x, y, _), end = robot.pose, pose_of(goal.pose)
    count = max(1, math.ceil(math.dist((x, y), end[:2]) / 0.05))
    line = [(x + (end[0] - x) * i / count, y + (end[1] - y) * i / count, end[2]) for i in range(1, count + 1)]
    try:
        yield from follow(robot, line)
    except GoalError as error:
        raise GoalError(NavigateToPose.Result.UNKNOWN, error.args[1]) from None


def spin(robot: Robot, goal):
    last, turned = robot.pose[2], 0.0
    while (left := abs(goal.target_yaw) - abs(turned)) >= 1e-6:
        speed = min(max(math.sqrt(2 * ROTATIONAL_ACC_LIM * left), MIN_ROTATIONAL_VEL), MAX_ROTATIONAL_VEL)
        yield 0.0, math.copysign(speed, goal.target_yaw)
        turned += math.remainder(robot.pose[2] - last, math.tau)
        last = robot.pose[2]


def back_up(robot: Robot, goal):
    begin = robot.pose
    while (left := abs(goal.target.x) - math.dist(robot.pose[:2], begin[:2])) > 0:
        speed = min(abs(goal.speed), math.sqrt(2 * DECELERATION_LIMIT * left))
        yield -max(speed, MINIMUM_SPEED), 0.0


rclpy.init()
node = rclpy.create_node("nav2_stand_in")
base = Robot(node)
servers = [
    Server(base, FollowPath, "follow_path", follow_path, CONTROLLER_HZ, replaces=True),
    Server(base, NavigateToPose, "navigate_to_pose", navigate_to_pose, CONTROLLER_HZ, replaces=True),
    Server(base, Spin, "spin", spin, CYCLE_HZ, replaces=False),
    Server(base, BackUp, "backup", back_up, CYCLE_HZ, replaces=False),
]
print("up")
executor = MultiThreadedExecutor(6)
executor.add_node(node)
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    executor.spin()
