"""A robot's own side, played around the embedded world: base and camera on the topics of a profile, over ROS 2.

Imported only where ROS 2 is installed.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any

from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image
from std_msgs.msg import Bool, String

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.ros2.interface import TWIST, ros2_interface
from vsnbench.ros2.messages import (
    COMMAND_CLASSES,
    camera_info_message,
    image_message,
    odometry_message,
    time_of,
    twist_of,
)
from vsnbench.ros2.node import LATCHED, SENSOR_DATA, Ros2Node
from vsnbench.ros2.questions import Answerer
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

NODE = "simulated_robot"


class SimulatedRobotNode:
    """Plays one robot until it is closed."""

    def __init__(self, node: Ros2Node, site: Site, profile: RobotProfile, options: SimulationOptions) -> None:
        self._node = node
        self._profile = profile
        self._names = ros2_interface(profile)
        self._options = options
        self._player = RobotPlayer(
            site, profile, options, self, self._names.camera_rate_hz, self._names.command_timeout_s
        )
        self._advertise()
        self._player.start()

    def close(self) -> None:
        """Stop playing."""
        self._player.close()

    def _advertise(self) -> None:
        names, node = self._names, self._node.rclpy

        def publisher(kind: Any, topic: str, qos: Any = SENSOR_DATA) -> Any:
            return node.create_publisher(kind, topic, qos) if topic else None

        def own(topic: str) -> str:
            return names.resolve(topic.lstrip("/"))

        self._odometry = publisher(Odometry, names.odometry)
        self._bumper = publisher(Bool, names.bumper)
        self._battery = publisher(BatteryState, names.battery)
        self._color, self._color_info = publisher(Image, names.color), publisher(CameraInfo, names.color_info)
        self._depth, self._depth_info = publisher(Image, names.depth), publisher(CameraInfo, names.depth_info)
        self._instances = publisher(Image, own(INSTANCES))
        self._truth = publisher(Odometry, own(GROUND_TRUTH))
        self._contact = publisher(String, own(CONTACT), LATCHED)
        self._clock = publisher(Clock, "/clock") if self._options.rate_factor != 1 else None
        self._account = publisher(String, own(ACCOUNT), LATCHED)
        self._account.publish(String(data=self._player.account.model_dump_json()))
        self._categories = publisher(String, own(CATEGORIES), LATCHED)
        self._categories.publish(String(data=json.dumps(self._player.categories)))
        self._contact.publish(String(data=""))
        node.create_subscription(
            COMMAND_CLASSES[names.command_type or TWIST], names.command, self._on_command, SENSOR_DATA
        )
        self._placing = Answerer(self._node, own(PLACE), self._put_down)

    def _on_command(self, message: Any) -> None:
        twist = twist_of(message)
        self._player.hear(Command(twist.linear.x, twist.angular.z))

    def _put_down(self, question: Mapping[str, Any], _gone: Callable[[], bool]) -> Mapping[str, Any]:
        try:
            x_m, y_m, heading_rad = (float(question[name]) for name in ("x_m", "y_m", "heading_rad"))
            seed = int(question.get("seed", 0))
        except (KeyError, TypeError, ValueError):
            return {"problem": "a place is x_m, y_m and heading_rad"}
        return {"problem": self._player.put_down(x_m, y_m, heading_rad, seed)}

    def tell_time(self, stamp_s: float) -> None:
        """Be the graph's clock, where it is simulated."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=time_of(stamp_s)))

    def tell_odometry(self, pose: Pose, stamp_s: float) -> None:
        """Publish what the base counted."""
        self._odometry.publish(odometry_message(pose, stamp_s, "odom"))

    def tell_truth(self, pose: Pose, stamp_s: float) -> None:
        """Publish where the robot truly stands, to whoever listens."""
        if self._truth.get_subscription_count():
            self._truth.publish(odometry_message(pose, stamp_s, "site"))

    def tell_battery(self, share: float, stamp_s: float) -> None:
        """Publish how the battery stands, as a Create 3 does on battery_state."""
        if self._battery is not None:
            discharging = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
            state = BatteryState(percentage=share, present=True, power_supply_status=discharging)
            state.header.stamp = time_of(stamp_s)
            self._battery.publish(state)

    def tell_lifted(self, lifted: bool) -> None:
        """Say nothing: no base of ROS 2 that we know has a topic for its wheels alone."""

    def tell_contact(self, _before: Contact | None, now: Contact | None) -> None:
        """Report a contact when it begins and when it ends."""
        self._contact.publish(String(data=now.name if now else ""))
        if self._bumper is not None:
            self._bumper.publish(Bool(data=now is not None and now.bumper is not None))

    def wants_pictures(self) -> bool:
        """Return whether anybody listens to an image."""
        return any(p is not None and p.get_subscription_count() for p in (self._color, self._depth, self._instances))

    def show(self, picture: Picture) -> None:
        """Publish the images and how the cameras are calibrated, as a camera that sits askew sees them."""
        turns, stamp_s = self._names.image_turns, picture.stamp_s
        if self._instances.get_subscription_count():
            self._instances.publish(image_message(picture.instances, "16UC1", stamp_s, turns))
        if self._depth is not None:
            self._depth.publish(image_message(picture.depth_mm, "16UC1", stamp_s, turns))
            if self._depth_info is not None:
                self._depth_info.publish(camera_info_message(self._profile, stamp_s, turns))
        self._color.publish(image_message(picture.rgb, "rgb8", stamp_s, turns))
        if self._color_info is not None:
            self._color_info.publish(camera_info_message(self._profile, stamp_s, turns))
