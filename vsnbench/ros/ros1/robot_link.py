"""The client's connection to a robot over ROS 1."""

import json
from collections.abc import Callable
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from vsnbench.control.command import Command
from vsnbench.ros.common.robot_link import RobotLink, placement_seed
from vsnbench.ros.ros1.exchange import Ros1Exchange
from vsnbench.ros.ros1.hazard_events import subscribe_hazards, subscribe_states
from vsnbench.ros.ros1.interface import Ros1Interface, ros1_interface
from vsnbench.ros.ros1.master import Master
from vsnbench.ros.ros1.messages import (
    DiscreteServer,
    DiscreteServerRequest,
    PlaceRobot,
    PlaceRobotRequest,
    twist_message,
)
from vsnbench.ros.ros1.node import leave_network, now_s, publish_while_open, start_node
from vsnbench.ros.ros1.readiness import Ros1Readiness
from vsnbench.ros.ros1.service_call import ServiceClient
from vsnbench.ros.ros1.service_words import words_of
from vsnbench.ros.ros1.subscriptions import Ros1Odometry, sender_of, subscribe_battery
from vsnbench.sensing.images.compressed_images import is_compressed
from vsnbench.sensing.simulation import ACCOUNT, INSTANCES, PLACE
from vsnbench.values.encoding.motion_answer import result_of_answer
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import ROS1
from vsnbench.values.robot_profile import RobotProfile

NODE = "vsnbench"
_IMAGE_BUFFER = 1 << 24


class Ros1Link(RobotLink):
    """Connection to a robot on a ROS 1 network; one per process."""

    kind = ROS1
    steer = None
    names: Ros1Interface
    _readiness: Ros1Readiness

    def __init__(self, profile: RobotProfile) -> None:
        super().__init__(profile)
        self.names = names = ros1_interface(profile)
        self.reports_lifting = bool(names.wheel_drop)
        self.master: Master = start_node(NODE)
        self.exchange = Ros1Exchange(self.master)
        self.discrete_move = ServiceClient(names.discrete_move, DiscreteServer, self.master)
        self._drive = ServiceClient(f"{names.discrete_move}/drive", DiscreteServer, self.master)
        self._reset = ServiceClient(f"{names.discrete_move}/reset", Trigger, self.master)
        self._place = ServiceClient(PLACE, PlaceRobot, self.master)
        self._commands = rospy.Publisher(names.command, Twist, queue_size=10, tcp_nodelay=True)
        # ROS calls this while the topics are open, also when another node ends this one.
        rospy.on_shutdown(self.stand_still)
        self._readiness = Ros1Readiness(
            names, self.snapshot, lambda: self.odometry.fault, profile, self.master, self.discrete_move
        )
        self.odometry = Ros1Odometry(names, self._on_odometry, take_attitude=self._reports.take_attitude)
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=20, tcp_nodelay=True)
        self._subscribe_camera()
        subscribe_hazards(names.hazard_topics, self._reports.take_hazard)
        subscribe_states(names, self._reports.take_hazard)
        subscribe_battery(names, self._reports.take_battery)
        self._paths = rospy.Publisher(names.paths, String, queue_size=2, tcp_nodelay=True)
        self._subscribe_text(f"{names.paths}_state", self._take_path_state)
        self._outcomes = rospy.Subscriber(
            f"{names.discrete_move}/outcome", String, self._on_outcome, queue_size=5, tcp_nodelay=True
        )

    def _disconnect(self) -> None:
        leave_network()

    @property
    def server(self) -> str:
        """Whose node of discrete_move serves: `vsnbench` or `another`."""
        ours = f"{self.names.discrete_move}/outcome" in self.master.state().publishers
        return "vsnbench" if ours else "another"

    @property
    def can_be_placed(self) -> bool:
        """Whether the robot is simulated and can be put at a start."""
        return PLACE in self.master.state().services

    @property
    def has_labels(self) -> bool:
        """Whether the robot is simulated and labels its images."""
        return INSTANCES in self.master.state().publishers

    @property
    def now_s(self) -> float:
        """Time in which motions are measured: monotonic, or simulated where /use_sim_time is set."""
        return now_s()

    @property
    def reports_outcomes(self) -> bool:
        """Whether the server of discrete_move is that of vsnbench, which reports more than True or False."""
        return bool(self._outcomes.get_num_connections())

    def join_simulation(self) -> None:
        """Subscribe to the topics that only a simulated robot has."""
        self._subscribe_text(ACCOUNT, self._reports.take_account)
        super().join_simulation()

    def command(self, command: Command) -> None:
        """Command a velocity, whatever executes movements; does nothing after ROS has closed the topic."""
        publish_while_open(self._commands, twist_message(command))

    @property
    def can_drive(self) -> bool:
        """Whether the node of discrete_move is that of vsnbench, which has a service for them."""
        return self._drive.name in self.master.state().services

    @property
    def follows_paths(self) -> bool:
        """Whether the node of discrete_move is that of vsnbench, which takes orders of paths."""
        return f"{self.names.paths}_state" in self.master.state().publishers

    def _publish_path(self, text: str) -> None:
        publish_while_open(self._paths, String(text))

    def drive(self, movement: Drive, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Call discrete_move for an action, or the service of vsnbench's node for a movement with parameters.

        See `ServiceClient.call` for its errors.
        """
        self._reports.take_outcome(None)
        if (words := words_of(movement)) is not None:
            return bool(self.discrete_move.call(DiscreteServerRequest(*words), timeout_s, watch).response)
        request = DiscreteServerRequest(json.dumps(movement.to_json()), 0)
        return bool(self._drive.call(request, timeout_s, watch).response)

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot at a pose. Returns why the robot cannot be there, or an empty string."""
        request = PlaceRobotRequest(pose.x_m, pose.y_m, pose.heading_rad, placement_seed(seed))
        answer = self._place.call(request, timeout_s)
        return "" if answer.success else str(answer.message)

    def begin_episode(self, timeout_s: float) -> None:
        """Reset the held heading of discrete_move, if its server offers that.

        The odometry of the base is not reset: a Kobuki resets it some time after the request and reports nothing when
        it has. The client stores the pose at the start instead.
        """
        if f"{self.names.discrete_move}/reset" in self.master.state().services:
            self._reset.call(Trigger._request_class(), timeout_s)  # noqa: SLF001

    def _subscribe_image(self, topic: str, field: str, capacity: int) -> None:
        def on_image(message: Any) -> None:
            stamp_s = message.header.stamp.to_sec()
            self._reports.take_image(field, capacity, message, stamp_s, topic, sender_of(message))

        kind = CompressedImage if is_compressed(topic) else Image
        rospy.Subscriber(topic, kind, on_image, queue_size=5, buff_size=_IMAGE_BUFFER, tcp_nodelay=True)

    def _subscribe_camera_info(self, topic: str, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, CameraInfo, take, queue_size=1)

    def _subscribe_text(self, topic: str, take: Callable[[str], None]) -> None:
        rospy.Subscriber(topic, String, lambda message: take(message.data), queue_size=20, tcp_nodelay=True)

    def _subscribe_truth(self, topic: str) -> None:
        def on_truth(message: Any) -> None:
            self._take_truth(message, message.header.stamp.to_sec())

        rospy.Subscriber(topic, Odometry, on_truth, queue_size=5, tcp_nodelay=True)

    def _on_odometry(self, pose: tuple[float, float, float], stamp_s: float, sender: str) -> None:
        self._reports.take_odometry(pose, stamp_s, self.names.odometry_topic, sender)

    def _on_command(self, message: Any) -> None:
        node = sender_of(message)
        if node != self.master.caller:
            self._take_command(message, node, rival=node not in self._readiness.steering)

    def _on_outcome(self, message: Any) -> None:
        self._reports.take_outcome(result_of_answer(json.loads(message.data)))
