"""A simulated robot on the ROS 2 topics of its profile."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy.typing as npt
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image
from std_msgs.msg import Bool, String

from vsnbench.ros.common.interface import TF_MESSAGE, OdometryFrames
from vsnbench.ros.common.simulated_robot import NODE, SimulatedRobotTask
from vsnbench.ros.ros2.installation import require_tf_message
from vsnbench.ros.ros2.interface import TWIST, Ros2Interface, ros2_interface
from vsnbench.ros.ros2.messages import (
    COMMAND_CLASSES,
    OPTICAL_FRAME,
    camera_info_message,
    image_message,
    odometry_message,
    time_of,
    twist_of,
)
from vsnbench.ros.ros2.node import LATCHED, SENSOR_DATA, Ros2Node
from vsnbench.ros.ros2.subscriptions import tf_message
from vsnbench.ros.ros2.topic_service import TopicServiceServer
from vsnbench.sensing.simulation import PLACE
from vsnbench.simulator.dynamics.simulated_base import Contact
from vsnbench.simulator.robot_player import SimulationOptions
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

__all__ = ["NODE", "Ros2SimulatedRobot"]

_COMMAND = "cmd_vel"
"""Topic of velocities for the adapter of a profile that names none."""
_CLASSES: dict[str, Any] = {
    "nav_msgs/Odometry": Odometry,
    "sensor_msgs/CameraInfo": CameraInfo,
    "sensor_msgs/Image": Image,
    "std_msgs/String": String,
}


class Ros2SimulatedRobot(SimulatedRobotTask):
    """Simulates one robot until it is closed."""

    color_frame = depth_frame = OPTICAL_FRAME
    names: Ros2Interface

    def __init__(self, node: Ros2Node, site: Site, profile: RobotProfile, options: SimulationOptions) -> None:
        self._node = node
        super().__init__(site, profile, ros2_interface(profile), options)

    def _advertise(self) -> None:
        names, node = self.names, self._node.rclpy
        self._bumper = node.create_publisher(Bool, names.bumper, SENSOR_DATA) if names.bumper else None
        self._battery = node.create_publisher(BatteryState, names.battery, SENSOR_DATA) if names.battery else None
        self._clock = node.create_publisher(Clock, "/clock", SENSOR_DATA) if self.options.rate_factor != 1 else None
        kind = COMMAND_CLASSES[names.command_type or TWIST]
        topic = names.command or names.resolve(_COMMAND)
        node.create_subscription(kind, topic, self._on_command, SENSOR_DATA)
        self._placement = TopicServiceServer(self._node, names.simulation_topic(PLACE), self._put_down)

    def _publisher(self, topic: str, kind: str, *, queue_size: int = 10, latched: bool = False) -> Any:  # noqa: ARG002
        if not topic:
            return None
        message_class = require_tf_message() if kind == TF_MESSAGE else _CLASSES[kind]
        return self._node.rclpy.create_publisher(message_class, topic, LATCHED if latched else SENSOR_DATA)

    def _subscribers(self, publisher: Any) -> int:
        return int(publisher.get_subscription_count())

    def publish_time(self, stamp_s: float) -> None:
        """Publish the simulated time, if it differs from real time."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=time_of(stamp_s)))

    def publish_battery(self, share: float, stamp_s: float) -> None:
        """Publish the charge of the battery, 0 to 1."""
        if self._battery is not None:
            discharging = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
            state = BatteryState(percentage=share, present=True, power_supply_status=discharging)
            state.header.stamp = time_of(stamp_s)
            self._battery.publish(state)

    def publish_lifted(self, lifted: bool) -> None:
        """Do nothing: no known base of ROS 2 has a topic for its wheels alone."""

    def _publish_bumper(self, before: Contact | None, now: Contact | None) -> None:  # noqa: ARG002
        if self._bumper is not None:
            self._bumper.publish(Bool(data=now is not None and now.bumper is not None))

    def _text_message(self, text: str) -> Any:
        return String(data=text)

    def _odometry_message(self, pose: Pose, stamp_s: float, frame_id: str) -> Any:
        return odometry_message(pose, stamp_s, frame_id)

    def _tf_message(self, odometry: Any, frames: OdometryFrames) -> Any:
        return tf_message(odometry, frames)

    def _image_message(self, pixels: npt.NDArray[Any], encoding: str, stamp_s: float, frame_id: str) -> Any:  # noqa: ARG002
        return image_message(pixels, encoding, stamp_s, self.names.image_turns)

    def _camera_info_message(self, camera: Camera, stamp_s: float, frame_id: str) -> Any:  # noqa: ARG002
        return camera_info_message(camera, stamp_s, self.names.image_turns)

    def _on_command(self, message: Any) -> None:
        self.take_velocity(twist_of(message))

    def _put_down(self, request: Mapping[str, Any], _gone: Callable[[], bool]) -> Mapping[str, Any]:
        try:
            x_m, y_m, heading_rad = (float(request[name]) for name in ("x_m", "y_m", "heading_rad"))
            seed = int(request.get("seed", 0))
        except (KeyError, TypeError, ValueError):
            return {"problem": "a pose needs the numbers x_m, y_m and heading_rad"}
        return {"problem": self.player.put_down(x_m, y_m, heading_rad, seed)}
