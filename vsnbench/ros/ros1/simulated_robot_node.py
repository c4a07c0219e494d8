"""A simulated robot on the ROS 1 topics of its profile."""

import logging
from typing import Any

import numpy.typing as npt
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Bool, Empty, String

from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.common.messages import PinholeMatrices, fill_image, fill_odometry
from vsnbench.ros.common.simulated_robot import NODE, SimulatedRobotTask
from vsnbench.ros.ros1.interface import Ros1Interface, ros1_interface
from vsnbench.ros.ros1.master import Master, MasterError
from vsnbench.ros.ros1.messages import (
    MESSAGE_CLASSES,
    BumperEvent,
    PlaceRobot,
    PlaceRobotResponse,
    WheelDropEvent,
    battery_message,
    tf_message,
)
from vsnbench.sensing.simulation import PLACE
from vsnbench.simulator.dynamics.simulated_base import Contact
from vsnbench.simulator.robot_player import SimulationOptions
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

__all__ = ["NODE", "Ros1SimulatedRobot"]

logger = logging.getLogger(__name__)


class Ros1SimulatedRobot(SimulatedRobotTask):
    """Simulates one robot until it is closed; the node must have been started."""

    color_frame = "camera_rgb_optical_frame"
    depth_frame = "camera_depth_optical_frame"
    names: Ros1Interface

    def __init__(self, site: Site, profile: RobotProfile, options: SimulationOptions, master: Master) -> None:
        self._master = master
        super().__init__(site, profile, ros1_interface(profile), options)

    def close(self) -> None:
        """Stop the simulation."""
        super().close()
        if self.options.rate_factor != 1:
            try:
                self._master.ask("deleteParam", "/use_sim_time")
            except (MasterError, LookupError) as error:
                logger.warning("the parameter /use_sim_time stays set: %s", error)

    def _advertise(self) -> None:
        names = self.names
        self._bumper = self._publisher(names.bumper, names.bumper_type)
        # Never published, because no site has cliffs; advertised because a Kobuki does.
        self._cliff = self._publisher(names.cliff, names.cliff_type)
        self._wheel_drop = self._publisher(names.wheel_drop, names.wheel_drop_type)
        self._battery = self._publisher(names.battery, names.battery_type, queue_size=1)
        self._clock = self._publisher("/clock", "rosgraph_msgs/Clock") if self.options.rate_factor != 1 else None
        rospy.Subscriber(names.command, Twist, self.take_velocity, queue_size=50, tcp_nodelay=True)
        if names.reset_odometry:
            rospy.Subscriber(names.reset_odometry, Empty, self._on_reset_odometry, queue_size=1)
        rospy.Service(PLACE, PlaceRobot, self._on_place)

    def _publisher(self, topic: str, kind: str, *, queue_size: int = 10, latched: bool = False) -> Any:
        if not topic:
            return None
        return rospy.Publisher(topic, MESSAGE_CLASSES[kind], queue_size=queue_size, latch=latched, tcp_nodelay=True)

    def _subscribers(self, publisher: Any) -> int:
        return int(publisher.get_num_connections())

    def _on_reset_odometry(self, _message: Any) -> None:
        self.player.reset_odometry()

    def _on_place(self, request: Any) -> Any:
        problem = self.player.put_down(request.x, request.y, request.heading, request.seed)
        return PlaceRobotResponse(not problem, problem)

    def publish_battery(self, share: float, stamp_s: float) -> None:
        """Publish the charge of the battery, 0 to 1; other fields of a Kobuki's state stay empty."""
        if self._battery is not None:
            stamp = rospy.Time.from_sec(stamp_s)
            self._battery.publish(battery_message(self.names.battery_type, share, stamp))

    def publish_lifted(self, lifted: bool) -> None:
        """Publish that the wheels dropped, as they do while the robot is lifted."""
        if self._wheel_drop is None:
            return
        if self._wheel_drop.data_class is Bool:
            self._wheel_drop.publish(Bool(lifted))
            return
        state = WheelDropEvent.DROPPED if lifted else WheelDropEvent.RAISED
        for wheel in (WheelDropEvent.LEFT, WheelDropEvent.RIGHT):
            self._wheel_drop.publish(WheelDropEvent(wheel, state))

    def publish_time(self, stamp_s: float) -> None:
        """Publish the simulated time, if it differs from real time."""
        if self._clock is not None:
            self._clock.publish(Clock(rospy.Time.from_sec(stamp_s)))

    def _publish_bumper(self, before: Contact | None, now: Contact | None) -> None:
        if self._bumper is None:
            return
        for contact, pressed in ((before, False), (now, True)):
            if contact is not None and contact.bumper is not None:
                self._bumper.publish(self._bumper_event(contact.bumper, pressed=pressed))

    def _text_message(self, text: str) -> Any:
        return String(text)

    def _odometry_message(self, pose: Pose, stamp_s: float, frame_id: str) -> Any:
        message = Odometry()
        message.header.stamp = rospy.Time.from_sec(stamp_s)
        fill_odometry(message, pose, frame_id, "base_footprint")
        return message

    def _tf_message(self, odometry: Any, frames: OdometryFrames) -> Any:
        return tf_message(odometry, frames)

    def _image_message(self, pixels: npt.NDArray[Any], encoding: str, stamp_s: float, frame_id: str) -> Any:
        message = Image()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp_s), frame_id
        fill_image(message, pixels, encoding)
        message.data = pixels.tobytes()
        return message

    def _camera_info_message(self, camera: Camera, stamp_s: float, frame_id: str) -> Any:
        matrices, info = PinholeMatrices.of(camera), CameraInfo()
        info.header.stamp, info.header.frame_id = rospy.Time.from_sec(stamp_s), frame_id
        info.width, info.height, info.distortion_model = matrices.width, matrices.height, "plumb_bob"
        info.K, info.P, info.R, info.D = matrices.k, matrices.p, list(matrices.r), list(matrices.d)
        return info

    def _bumper_event(self, part: int, *, pressed: bool) -> Any:
        if self._bumper.data_class is Bool:
            return Bool(pressed)
        return BumperEvent(part, BumperEvent.PRESSED if pressed else BumperEvent.RELEASED)
