"""The robot's own side of the stack, played around the embedded world: robot_api and camera_api on real ROS 1 topics.

Imported only where ROS is installed.
"""

import json
import logging
import math
from typing import Any

import numpy.typing as npt
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Bool, Empty, String

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.ros1.battery import BATTERY_CLASSES, battery_message
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master, MasterError
from vsnbench.ros1.messages import BumperEvent, CliffEvent, PlaceRobot, PlaceRobotResponse, WheelDropEvent
from vsnbench.sensing.simulation import (
    ACCOUNT,
    CATEGORIES,
    CONTACT,
    GROUND_TRUTH,
    INSTANCES,
    PLACE,
)
from vsnbench.simulator.robot_player import Picture, RobotPlayer, SimulationOptions
from vsnbench.simulator.simulated_base import Contact

logger = logging.getLogger(__name__)

NODE = "simulated_robot"


class SimulatedRobotNode:
    """Plays one robot until it is closed; the node must have been started."""

    def __init__(self, site: Site, profile: RobotProfile, options: SimulationOptions, master: Master) -> None:
        self._master = master
        self._profile = profile
        self._names = ros1_interface(profile)
        self._options = options
        self._player = RobotPlayer(
            site, profile, options, self, self._names.camera_rate_hz, self._names.command_timeout_s
        )
        self._advertise()
        self._player.start()

    def close(self) -> None:
        """Stop playing."""
        self._player.close()
        if self._options.rate_factor != 1:
            try:
                self._master.ask("deleteParam", "/use_sim_time")
            except (MasterError, LookupError) as error:
                logger.warning("/use_sim_time stays set: %s", error)

    def _advertise(self) -> None:
        names = self._names

        def publisher(topic: str, kind: Any, *, latch: bool = False, queue: int = 10) -> Any:
            return rospy.Publisher(topic, kind, queue_size=queue, latch=latch, tcp_nodelay=True) if topic else None

        self._odometry = publisher(names.odometry, Odometry)
        self._bumper = publisher(names.bumper, BumperEvent if names.bumper_type.startswith("kobuki") else Bool)
        # Advertised as a base does; an apartment has no cliffs.
        self._cliff = publisher(names.cliff, CliffEvent if names.cliff_type.startswith("kobuki") else Bool)
        self._wheel_drop = publisher(
            names.wheel_drop, WheelDropEvent if names.wheel_drop_type.startswith("kobuki") else Bool
        )
        self._battery = publisher(names.battery, BATTERY_CLASSES[names.battery_type], queue=1)
        self._color = publisher(names.color, Image, queue=1)
        self._color_info = publisher(names.color_info, CameraInfo, queue=1)
        self._depth = publisher(names.depth, Image, queue=1)
        self._depth_info = publisher(names.depth_info, CameraInfo, queue=1)
        self._truth = publisher(GROUND_TRUTH, Odometry)
        self._contact = publisher(CONTACT, String, latch=True)
        self._instances = publisher(INSTANCES, Image, queue=1)
        self._clock = publisher("/clock", Clock) if self._options.rate_factor != 1 else None
        account = publisher(ACCOUNT, String, latch=True)
        account.publish(String(self._player.account.model_dump_json()))
        categories = publisher(CATEGORIES, String, latch=True)
        categories.publish(String(json.dumps(self._player.categories)))
        self._contact.publish(String(""))
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=50, tcp_nodelay=True)
        if names.reset_odometry:
            rospy.Subscriber(names.reset_odometry, Empty, self._on_reset_odometry, queue_size=1)
        rospy.Service(PLACE, PlaceRobot, self._on_place)

    def _on_command(self, twist: Any) -> None:
        self._player.hear(Command(twist.linear.x, twist.angular.z))

    def _on_reset_odometry(self, _message: Any) -> None:
        self._player.reset_odometry()

    def _on_place(self, request: Any) -> Any:
        problem = self._player.put_down(request.x, request.y, request.heading, request.seed)
        return PlaceRobotResponse(not problem, problem)

    def tell_battery(self, share: float, stamp_s: float) -> None:
        """Publish how the battery stands, as the profile's base does; nothing else of a Kobuki's state is told."""
        if self._battery is not None:
            stamp = rospy.Time.from_sec(stamp_s)
            self._battery.publish(battery_message(self._names.battery_type, share, stamp))

    def tell_lifted(self, lifted: bool) -> None:
        """Drop the wheels while a person has the robot in hand."""
        if self._wheel_drop is None:
            return
        if self._wheel_drop.data_class is Bool:
            self._wheel_drop.publish(Bool(lifted))
            return
        state = WheelDropEvent.DROPPED if lifted else WheelDropEvent.RAISED
        for wheel in (WheelDropEvent.LEFT, WheelDropEvent.RIGHT):
            self._wheel_drop.publish(WheelDropEvent(wheel, state))

    def tell_time(self, stamp_s: float) -> None:
        """Be the network's clock, where it is simulated."""
        if self._clock is not None:
            self._clock.publish(Clock(rospy.Time.from_sec(stamp_s)))

    def tell_odometry(self, pose: Pose, stamp_s: float) -> None:
        """Publish what the base counted."""
        self._odometry.publish(_odometry_message(pose, rospy.Time.from_sec(stamp_s), "odom"))

    def tell_truth(self, pose: Pose, stamp_s: float) -> None:
        """Publish where the robot truly stands, to whoever listens."""
        if self._truth.get_num_connections():
            self._truth.publish(_odometry_message(pose, rospy.Time.from_sec(stamp_s), "site"))

    def tell_contact(self, _before: Contact | None, now: Contact | None) -> None:
        """Report a contact when it begins and when it ends."""
        self._contact.publish(String(now.name if now else ""))
        if self._bumper is not None:
            for change, pressed in ((_before, False), (now, True)):
                if change is not None and change.bumper is not None:
                    self._bumper.publish(self._bumper_event(change.bumper, pressed=pressed))

    def wants_pictures(self) -> bool:
        """Return whether anybody listens to an image."""
        return any(p is not None and p.get_num_connections() for p in (self._color, self._depth, self._instances))

    def show(self, picture: Picture) -> None:
        """Publish the images and how the cameras are calibrated."""
        stamp = rospy.Time.from_sec(picture.stamp_s)
        if self._instances.get_num_connections():
            self._instances.publish(_image(picture.instances, "16UC1", stamp))
        if self._depth is not None:
            self._depth.publish(_image(picture.depth_mm, "16UC1", stamp))
            if self._depth_info is not None:
                self._depth_info.publish(_camera_info(self._profile, stamp, "camera_depth_optical_frame"))
        self._color.publish(_image(picture.rgb, "rgb8", stamp))
        if self._color_info is not None:
            self._color_info.publish(_camera_info(self._profile, stamp, "camera_rgb_optical_frame"))

    def _bumper_event(self, part: int, *, pressed: bool) -> Any:
        if self._bumper.data_class is Bool:
            return Bool(pressed)
        return BumperEvent(part, BumperEvent.PRESSED if pressed else BumperEvent.RELEASED)


def _image(pixels: npt.NDArray[Any], encoding: str, stamp: Any) -> Any:
    message = Image()
    message.header.stamp = stamp
    message.header.frame_id = "camera_rgb_optical_frame" if encoding == "rgb8" else "camera_depth_optical_frame"
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.step = pixels[0].nbytes
    message.data = pixels.tobytes()
    return message


def _camera_info(profile: RobotProfile, stamp: Any, frame_id: str) -> Any:
    camera = profile.camera
    focal, (cx, cy) = camera.focal_px, camera.center_px
    info = CameraInfo()
    info.header.stamp = stamp
    info.header.frame_id = frame_id
    info.width, info.height = camera.width, camera.height
    info.distortion_model = "plumb_bob"
    info.D = [0.0] * 5
    info.K = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
    info.R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.P = [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info


def _odometry_message(pose: Pose, stamp: Any, frame_id: str) -> Any:
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    message.child_frame_id = "base_footprint"
    message.pose.pose.position.x, message.pose.pose.position.y = pose.position
    message.pose.pose.orientation.z = math.sin(pose.heading_rad / 2)
    message.pose.pose.orientation.w = math.cos(pose.heading_rad / 2)
    return message
