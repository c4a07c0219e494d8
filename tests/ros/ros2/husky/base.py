"""A Clearpath Husky A200 in PyBullet on ROS 2, without vsnbench: `base.py SITE LOG`.

Physics are PyBullet's: four driven wheels with friction contacts, so that the base skids when it turns. Limits, timeout
and the effective track are those of husky_control/config/control.yaml in https://github.com/husky/husky. As there, the
odometry fuses the distance of the wheel encoders with the heading of a gyroscope (config/localization.yaml); it does
not see that the base slides. The stamps are the time of the physics.

Each line on stdin has one answer, which is JSON: `put X Y DEG` is an operator who puts the robot there with its drivers
switched off, so that the odometry continues where it was; `where` tells the truth. The robot starts with the first
`put`. LOG receives stamp, odometry and truth (x, y, heading) of each period of the odometry.
"""

import itertools
import json
import math
import multiprocessing
import queue
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pybullet
import pybullet_data
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.signals import SignalHandlerOptions

from tests.ros.ros2.husky import camera, world

STEP_S = 1 / 250
STEPS_PER_READING = 5
WHEEL_RADIUS_M, TRACK_M = 0.17775, 0.5708
"""Of the URDF's collision shapes and joints."""
TRACK_MULTIPLIER = 1.875
MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 1.0, 2.0
MAX_LINEAR_M_S2, MAX_ANGULAR_RAD_S2 = 3.0, 6.0
COMMAND_TIMEOUT_S = 0.25
MAX_TORQUE_NM = 30.0
"""Of each wheel; 27 Nm carry it up a slope of 30 degrees with 75 kg, the limits of its data sheet."""
FLOOR_FRICTION = 0.6
"""Rubber on a sealed floor; the URDF has 1.0 for the wheels, and PyBullet multiplies both."""


class Husky:
    """Physics, motor control and odometry."""

    def __init__(self, site: Path) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.81)
        # With its default, a friction cone, PyBullet's base slides to one side when it turns on the spot.
        pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP_S, enableConeFriction=0)
        bodies = world.build(site, self.client)
        self.room = {body: name for name, body in bodies.items()}
        pybullet.changeDynamics(bodies["floor"], -1, lateralFriction=FLOOR_FRICTION)
        self.body = pybullet.loadURDF(f"{pybullet_data.getDataPath()}/husky/husky.urdf")
        self.wheels: dict[int, int] = {}
        for joint in range(-1, pybullet.getNumJoints(self.body)):
            if joint >= 0 and b"wheel" in (name := pybullet.getJointInfo(self.body, joint)[1]):
                self.wheels[joint] = 1 if b"right" in name else -1
            elif pybullet.getDynamicsInfo(self.body, joint)[0] == 1.0:
                # PyBullet's default for a link without a mass; the Husky would be 6 kg heavier.
                pybullet.changeDynamics(self.body, joint, mass=1e-3, localInertiaDiagonal=(1e-6, 1e-6, 1e-6))
        self.odometry = [0.0, 0.0, 0.0]
        self.velocity = (0.0, 0.0)
        self.chair = bodies["chair-1"]
        self.touched: set[str] = set()
        self._angles_rad = self._read_angles()

    def put(self, x_m: float, y_m: float, heading_rad: float) -> None:
        turned = pybullet.getQuaternionFromEuler((0.0, 0.0, heading_rad))
        pybullet.resetBasePositionAndOrientation(self.body, (x_m, y_m, 0.0), turned)
        pybullet.resetBaseVelocity(self.body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.touched.clear()

    def step(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Drive for one step towards a commanded velocity."""
        wanted = (_within(linear_m_s, MAX_LINEAR_M_S), _within(angular_rad_s, MAX_ANGULAR_RAD_S))
        limits = (MAX_LINEAR_M_S2 * STEP_S, MAX_ANGULAR_RAD_S2 * STEP_S)
        changes = [_within(new - old, limit) for new, old, limit in zip(wanted, self.velocity, limits, strict=True)]
        self.velocity = (self.velocity[0] + changes[0], self.velocity[1] + changes[1])
        for wheel, side in self.wheels.items():
            rim_m_s = self.velocity[0] + side * self.velocity[1] * TRACK_MULTIPLIER * TRACK_M / 2
            pybullet.setJointMotorControl2(
                *(self.body, wheel, pybullet.VELOCITY_CONTROL),
                targetVelocity=rim_m_s / WHEEL_RADIUS_M,
                force=MAX_TORQUE_NM,
            )
        pybullet.stepSimulation()
        self._integrate()
        self.touched |= {self.room[point[2]] for point in pybullet.getContactPoints(self.body)} - {"floor"}

    def _integrate(self) -> None:
        angles_rad = self._read_angles()
        rolled_rad = [new - old for new, old in zip(angles_rad, self._angles_rad, strict=True)]
        self._angles_rad = angles_rad
        way_m = WHEEL_RADIUS_M * sum(rolled_rad) / len(rolled_rad)
        turn_rad = pybullet.getBaseVelocity(self.body)[1][2] * STEP_S
        middle_rad = self.odometry[2] + turn_rad / 2
        self.odometry[0] += way_m * math.cos(middle_rad)
        self.odometry[1] += way_m * math.sin(middle_rad)
        self.odometry[2] += turn_rad

    def _read_angles(self) -> list[float]:
        return [state[0] for state in pybullet.getJointStates(self.body, list(self.wheels))]

    @property
    def pose(self) -> tuple[Any, Any]:
        """True position and quaternion."""
        return pybullet.getBasePositionAndOrientation(self.body)

    @property
    def truth(self) -> tuple[float, float, float]:
        """True x, y and heading."""
        (x_m, y_m, _), turned = self.pose
        return x_m, y_m, pybullet.getEulerFromQuaternion(turned)[2]

    def report(self) -> dict[str, Any]:
        """Return what is true: the pose, the distance of its centre to the chair, and what it touched."""
        x_m, y_m, heading_rad = self.truth
        low, high = pybullet.getAABB(self.chair)
        beside_m = [max(a - c, c - b, 0.0) for a, b, c in zip(low[:2], high[:2], (x_m, y_m), strict=True)]
        return {
            "x_m": x_m,
            "y_m": y_m,
            "heading_deg": math.degrees(heading_rad),
            "chair_m": math.hypot(*beside_m),
            "touched": sorted(self.touched),
            "linear_m_s": math.hypot(*pybullet.getBaseVelocity(self.body)[0][:2]),
            "angular_rad_s": abs(pybullet.getBaseVelocity(self.body)[1][2]),
        }


class Driver:
    """ROS 2 node of the base: it takes velocities and publishes odometry."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("husky_velocity_controller")
        self._publisher = self.node.create_publisher(Odometry, "odometry/filtered", 10)
        self._command, self._heard_s = (0.0, 0.0), -math.inf
        self.node.create_subscription(Twist, "husky_velocity_controller/cmd_vel_unstamped", self._hear, 10)
        threading.Thread(target=rclpy.spin, args=(self.node,), daemon=True).start()

    def _hear(self, twist: Twist) -> None:
        self._command, self._heard_s = (twist.linear.x, twist.angular.z), time.monotonic()

    @property
    def command(self) -> tuple[float, float]:
        """The commanded velocity; zero after the timeout."""
        return self._command if time.monotonic() - self._heard_s < COMMAND_TIMEOUT_S else (0.0, 0.0)

    def publish(self, husky: Husky, stamp_s: float) -> None:
        message = Odometry(child_frame_id="base_link")
        message.header.stamp, message.header.frame_id = camera.stamp_of(stamp_s), "odom"
        x_m, y_m, heading_rad = husky.odometry
        message.pose.pose.position.x, message.pose.pose.position.y = x_m, y_m
        message.pose.pose.orientation.z = math.sin(heading_rad / 2)
        message.pose.pose.orientation.w = math.cos(heading_rad / 2)
        message.twist.twist.linear.x, message.twist.twist.angular.z = husky.velocity
        self._publisher.publish(message)


def _within(value: float, limit: float) -> float:
    return max(-limit, min(value, limit))


def _answer(husky: Husky, line: str) -> None:
    word, *numbers = line.split()
    if word == "put":
        x_m, y_m, heading_deg = map(float, numbers)
        husky.put(x_m, y_m, math.radians(heading_deg))
    sys.stdout.write(f"\n{json.dumps(husky.report())}\n")  # PyBullet leaves its own last line open
    sys.stdout.flush()


def _listen(lines: "queue.SimpleQueue[str]") -> None:
    """Pass on the lines of stdin, and an empty one at its end: whoever started the robot is gone."""
    for line in itertools.chain(sys.stdin, [""]):
        lines.put(line)


def main(site: Path, log: Path) -> None:
    spawning = multiprocessing.get_context("spawn")
    shared, lines = spawning.Array("d", 8), queue.SimpleQueue[str]()
    husky = Husky(site)
    threading.Thread(target=_listen, args=(lines,), daemon=True).start()
    _answer(husky, lines.get())
    signal.signal(signal.SIGTERM, lambda *_: lines.put(""))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    driver = Driver()
    began_s, epoch_s, steps = time.monotonic(), time.time(), 0
    _share(husky, shared, epoch_s)
    spawning.Process(target=camera.serve, args=(site, shared), daemon=True).start()
    with log.open("w", encoding="utf-8", buffering=1) as readings:
        while True:
            time.sleep(max(0.0, began_s + steps * STEP_S - time.monotonic()))
            while not lines.empty():
                if not (line := lines.get()):
                    return
                _answer(husky, line)
            husky.step(*driver.command)
            steps += 1
            if steps % STEPS_PER_READING == 0:
                stamp_s = epoch_s + steps * STEP_S
                _share(husky, shared, stamp_s)
                driver.publish(husky, stamp_s)
                readings.write(json.dumps([stamp_s, *husky.odometry, *husky.truth]) + "\n")


def _share(husky: Husky, shared: Any, stamp_s: float) -> None:
    position, turned = husky.pose
    with shared.get_lock():
        shared[:] = [stamp_s, *position, *turned]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
