"""A simulated robot on the topics of its profile."""

import json
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from vsnbench.ros.common.interface import OdometryFrames, RosInterface
from vsnbench.ros.common.messages import command_of, fill_orientation
from vsnbench.ros.common.node import NodeTask
from vsnbench.sensing.simulation import ACCOUNT, CATEGORIES, CONTACT, GROUND_TRUTH, INSTANCES
from vsnbench.simulator.dynamics.simulated_base import Contact
from vsnbench.simulator.robot_player import CameraImages, RobotOutlet, RobotPlayer, SimulationOptions
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.pose import LEVEL, Attitude, Pose
from vsnbench.values.robot_profile import RobotProfile

NODE = "simulated_robot"
ODOMETRY, TEXT = "nav_msgs/Odometry", "std_msgs/String"
IMAGE, CAMERA_INFO = "sensor_msgs/Image", "sensor_msgs/CameraInfo"


class SimulatedRobotTask(NodeTask, RobotOutlet):
    """Publishes the sensors of a simulated robot until it is closed; subclasses connect it to a middleware."""

    color_frame: str
    depth_frame: str

    def __init__(self, site: Site, profile: RobotProfile, names: RosInterface, options: SimulationOptions) -> None:
        self.profile = profile
        self.names = names
        self.options = options
        self.player = RobotPlayer(site, profile, options, self, names.camera_rate_hz, names.command_timeout_s)
        self._odometry = self._publisher(names.odometry_topic, names.odometry_type)
        self._color = self._publisher(names.color, IMAGE, queue_size=1)
        self._color_info = self._publisher(names.color_info, CAMERA_INFO, queue_size=1)
        self._depth = self._publisher(names.depth, IMAGE, queue_size=1)
        self._depth_info = self._publisher(names.depth_info, CAMERA_INFO, queue_size=1)
        self._further = {
            role: tuple(
                self._publisher(topic, kind, queue_size=1)
                for topic, kind in (
                    *((topics.color, IMAGE), (topics.color_info, CAMERA_INFO)),
                    *((topics.depth, IMAGE), (topics.depth_info, CAMERA_INFO)),
                )
            )
            for role, topics in names.cameras.items()
            if role in profile.cameras
        }
        self._truth = self._publisher(names.simulation_topic(GROUND_TRUTH), ODOMETRY)
        self._instances = self._publisher(names.simulation_topic(INSTANCES), IMAGE, queue_size=1)
        self._contact = self._publish_text(CONTACT, "")
        self._account = self._publish_text(ACCOUNT, self.player.account.model_dump_json(by_alias=True))
        self._categories = self._publish_text(CATEGORIES, json.dumps(self.player.categories))
        self._advertise()
        self.player.start()

    def close(self) -> None:
        """Stop the simulation."""
        self.player.close()

    @abstractmethod
    def _advertise(self) -> None:
        """Open the topics and services that the middlewares do not share."""

    @abstractmethod
    def _publisher(self, topic: str, kind: str, *, queue_size: int = 10, latched: bool = False) -> Any:
        """Return a publisher, or None for an empty topic."""

    @abstractmethod
    def _subscribers(self, publisher: Any) -> int:
        """Return the number of subscribers of a publisher."""

    @abstractmethod
    def _text_message(self, text: str) -> Any:
        """Return a std_msgs/String."""

    @abstractmethod
    def _odometry_message(self, pose: Pose, stamp_s: float, frame_id: str) -> Any:
        """Return a nav_msgs/Odometry."""

    @abstractmethod
    def _tf_message(self, odometry: Any, frames: OdometryFrames) -> Any:
        """Return a nav_msgs/Odometry as tf2_msgs/TFMessage."""

    @abstractmethod
    def _image_message(self, pixels: npt.NDArray[Any], encoding: str, stamp_s: float, frame_id: str) -> Any:
        """Return a sensor_msgs/Image."""

    @abstractmethod
    def _camera_info_message(self, camera: Camera, stamp_s: float, frame_id: str) -> Any:
        """Return the calibration of a camera of the profile as sensor_msgs/CameraInfo."""

    @abstractmethod
    def _publish_bumper(self, before: Contact | None, now: Contact | None) -> None:
        """Publish the change of a contact on the topic of the bumper."""

    def take_velocity(self, twist: Any) -> None:
        """Take a geometry_msgs/Twist."""
        self.player.set_command(command_of(twist))

    def publish_odometry(self, pose: Pose, stamp_s: float, attitude: Attitude) -> None:
        """Publish the odometry."""
        message = self._odometry_message(pose, stamp_s, "odom")
        if attitude != LEVEL:
            fill_orientation(message.pose.pose.orientation, pose.heading_rad, attitude)
        self._odometry.publish(self._tf_message(message, self.names.tf) if self.names.tf else message)

    def publish_truth(self, pose: Pose, stamp_s: float) -> None:
        """Publish the pose in the site's frame, if a node subscribes to it."""
        if self._subscribers(self._truth):
            self._truth.publish(self._odometry_message(pose, stamp_s, "site"))

    def publish_contact(self, before: Contact | None, now: Contact | None) -> None:
        """Publish that a contact began, changed or ended."""
        self._contact.publish(self._text_message(now.name if now else ""))
        self._publish_bumper(before, now)

    def watched_cameras(self) -> frozenset[CameraRole]:
        """Return the roles of the cameras to whose images a node subscribes."""
        images: dict[CameraRole, tuple[Any, ...]] = {CameraRole.FRONT: (self._color, self._depth, self._instances)}
        images |= {role: (color, depth) for role, (color, _, depth, _) in self._further.items()}
        return frozenset(
            role
            for role, publishers in images.items()
            if any(publisher is not None and self._subscribers(publisher) for publisher in publishers)
        )

    def publish_images(self, images: Mapping[CameraRole, CameraImages]) -> None:
        """Publish the images and calibrations of cameras."""
        for role, seen in images.items():
            if role is CameraRole.FRONT:
                if self._subscribers(self._instances):
                    instances = self._image_message(seen.instances, "16UC1", seen.stamp_s, self.depth_frame)
                    self._instances.publish(instances)
                main = (self._color, self._color_info, self._depth, self._depth_info)
                self._publish_images(main, seen, self.profile.camera, self.color_frame, self.depth_frame)
            else:
                frame = f"{role}_camera_optical_frame"
                self._publish_images(self._further[role], seen, self.profile.cameras[role], frame, frame)

    def _publish_images(
        self, publishers: tuple[Any, ...], seen: CameraImages, camera: Camera, color_frame: str, depth_frame: str
    ) -> None:
        """Publish colour, its calibration, depth and its calibration, as far as there are publishers."""
        color, color_info, depth, depth_info = publishers
        if depth is not None:
            depth.publish(self._image_message(seen.depth_mm, "16UC1", seen.stamp_s, depth_frame))
            if depth_info is not None:
                depth_info.publish(self._camera_info_message(camera, seen.stamp_s, depth_frame))
        color.publish(self._image_message(seen.rgb, "rgb8", seen.stamp_s, color_frame))
        if color_info is not None:
            color_info.publish(self._camera_info_message(camera, seen.stamp_s, color_frame))

    def _publish_text(self, topic: str, text: str) -> Any:
        """Return a latched publisher of std_msgs/String that has published `text`."""
        opened = self._publisher(self.names.simulation_topic(topic), TEXT, latched=True)
        opened.publish(self._text_message(text))
        return opened
