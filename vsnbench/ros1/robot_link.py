"""The client's connections to a robot: snapshots of what its topics reported, zero velocity, its services.

Imported only where ROS is installed.
"""

import json
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from vsnbench.errors import RobotError
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import ROS1
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.battery import subscribe_battery
from vsnbench.ros1.hazard_events import subscribe_hazard
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master
from vsnbench.ros1.messages import DiscreteServer, DiscreteServerRequest, PlaceRobot, PlaceRobotRequest
from vsnbench.ros1.node import now_s, publish_while_open, start_node
from vsnbench.ros1.readiness import missing_part
from vsnbench.ros1.service_call import ServiceClient
from vsnbench.sensing.discrete_mover import Hazard, Outcome
from vsnbench.sensing.odometry import heading_of_quaternion
from vsnbench.sensing.robot_reports import RobotReports
from vsnbench.sensing.simulation import ACCOUNT, CATEGORIES, CONTACT, GROUND_TRUTH, INSTANCES, PLACE

NODE = "vsnbench"
_COLOR_FRAMES = 6
_IMAGE_BUFFER = 1 << 24


class RobotLink:
    """Everything that a client hears from a robot and can ask of it; one a process.

    Messages come in threads of ROS and go to its RobotReports.
    """

    kind = ROS1
    image_turns = 0

    def __init__(self, profile: RobotProfile) -> None:
        names = ros1_interface(profile)
        self._profile_name = profile.name
        self._reports = RobotReports(profile)
        self.snapshot = self._reports.snapshot
        self.wait_for = self._reports.wait_for
        self.clear_events = self._reports.clear_events
        self.master: Master = start_node(NODE)
        self.names = names
        self.tells_of_lifting = bool(names.wheel_drop)
        self.discrete_move = ServiceClient(names.discrete_move, DiscreteServer, self.master, self.master.caller)
        self._reset = ServiceClient(f"{names.discrete_move}/reset", Trigger, self.master, self.master.caller)
        self._place = ServiceClient(PLACE, PlaceRobot, self.master, self.master.caller)
        self._commands = rospy.Publisher(names.command, Twist, queue_size=10, tcp_nodelay=True)
        self._holding = threading.Event()
        # Whoever ends this node, the robot does not drive on: ROS runs this while the topics are open.
        rospy.on_shutdown(self.stand_still)
        self._subscribe()

    def close(self) -> None:
        """Leave the ROS network."""
        # What was published last leaves through rospy's own threads.
        time.sleep(0.05)
        rospy.signal_shutdown("closed")

    def image(self, payload: Any) -> Any:
        """Return an image of a snapshot as a message: it is one."""
        return payload

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer and what to do about it; None when all do.

        Raises:
            RobotError: the master was restarted, which no patience heals.
        """
        return missing_part(self, self._profile_name, warned)

    @property
    def server(self) -> str:
        """Whose discrete_move serves: `vsnbench` or `another`."""
        ours = f"{self.names.discrete_move}/outcome" in self.master.state().publishers
        return "vsnbench" if ours else "another"

    @property
    def can_be_placed(self) -> bool:
        """Whether the robot is a simulated one that a service puts where it should start."""
        return PLACE in self.master.state().services

    @property
    def has_labels(self) -> bool:
        """Whether the robot is a simulated one that labels what its camera sees."""
        return INSTANCES in self.master.state().publishers

    @property
    def now_s(self) -> float:
        """The time that motions are measured in: monotonic, or simulated where the network's time is."""
        return now_s()

    @property
    def reports_outcomes(self) -> bool:
        """Whether the server of discrete_move is ours, which says more than its answer's bool."""
        return bool(self._outcomes.get_num_connections())

    @property
    def holding(self) -> bool:
        """Whether the base is held still against others."""
        return self._holding.is_set()

    def join_simulation(self) -> None:
        """Listen to what only a simulated robot reports."""
        rospy.Subscriber(ACCOUNT, String, self._on_account, queue_size=2)
        rospy.Subscriber(GROUND_TRUTH, Odometry, self._on_truth, queue_size=5, tcp_nodelay=True)
        rospy.Subscriber(CONTACT, String, self._on_contact, queue_size=20, tcp_nodelay=True)
        if self.has_labels:
            self._subscribe_image(INSTANCES, "labels", _COLOR_FRAMES)
            rospy.Subscriber(CATEGORIES, String, self._on_categories, queue_size=1)

    def stand_still(self) -> None:
        """Command zero velocity; a node that ROS has ended said so when it ended, and reaches no robot any more."""
        publish_while_open(self._commands, Twist())

    def hold_still(self) -> None:
        """Command zero velocity, and answer every velocity that somebody else commands with zero at once."""
        self._holding.set()
        self.stand_still()

    def release(self) -> None:
        """Let others steer again."""
        self._holding.clear()

    def move(self, movement: str, angle_deg: int, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Ask discrete_move for one movement and return its answer; see `ServiceClient.call` for what it raises."""
        self._reports.take_outcome(None)
        request = DiscreteServerRequest(movement, angle_deg)
        return bool(self.discrete_move.call(request, timeout_s, watch).response)

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot down; returns why it cannot stand there, empty when it does."""
        seed_63 = seed & 0x7FFF_FFFF_FFFF_FFFF
        answer = self._place.call(PlaceRobotRequest(pose.x_m, pose.y_m, pose.heading_rad, seed_63), timeout_s)
        return "" if answer.success else str(answer.message)

    def begin_episode(self, timeout_s: float) -> None:
        """Tell discrete_move that an episode starts here, where it can be told.

        The base is not asked to zero its odometry: a Kobuki does so some time after it was asked, heading and all, and
        nothing says when. The start of an episode is a pose that the client remembers.
        """
        if f"{self.names.discrete_move}/reset" in self.master.state().services:
            self._reset.call(Trigger._request_class(), timeout_s)  # noqa: SLF001

    def _subscribe(self) -> None:
        names = self.names
        rospy.Subscriber(names.odometry, Odometry, self._on_odometry, queue_size=20, tcp_nodelay=True)
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=20, tcp_nodelay=True)
        self._subscribe_image(names.color, "colors", _COLOR_FRAMES)
        if names.depth:
            self._subscribe_image(names.depth, "depths", names.depth_frames + 2)
        for hazard in Hazard:
            subscribe_hazard(names, hazard, self._reports.take_hazard)
        subscribe_battery(names, self._reports.take_battery)
        self._outcomes = rospy.Subscriber(
            f"{names.discrete_move}/outcome", String, self._on_outcome, queue_size=5, tcp_nodelay=True
        )

    def _subscribe_image(self, topic: str, field: str, most: int) -> None:
        def on_image(message: Any) -> None:
            stamp_s = message.header.stamp.to_sec()
            self._reports.take_image(field, most, message, stamp_s, topic, _sender(message))

        rospy.Subscriber(topic, Image, on_image, queue_size=5, buff_size=_IMAGE_BUFFER, tcp_nodelay=True)

    def _on_odometry(self, message: Any) -> None:
        stamp_s = message.header.stamp.to_sec()
        self._reports.take_odometry(_planar(message), stamp_s, self.names.odometry, _sender(message))

    def _on_command(self, message: Any) -> None:
        node, moves = _sender(message), any((message.linear.x, message.linear.y, message.angular.z))
        if node == self.master.caller:
            return
        if moves and self._holding.is_set():
            self.stand_still()
        self._reports.take_command(node, moves=moves)

    def _on_contact(self, message: Any) -> None:
        self._reports.take_contact(message.data)

    def _on_truth(self, message: Any) -> None:
        self._reports.take_truth(_planar(message), message.header.stamp.to_sec())

    def _on_outcome(self, message: Any) -> None:
        self._reports.take_outcome(Outcome(**json.loads(message.data)))

    def _on_categories(self, message: Any) -> None:
        self._reports.take_categories(message.data)

    def _on_account(self, message: Any) -> None:
        self._reports.take_account(message.data)


def _sender(message: Any) -> str:
    """Return the node that published a message."""
    return str(message._connection_header.get("callerid", "?"))  # noqa: SLF001


def _planar(message: Any) -> tuple[float, float, float]:
    """Return x, y and heading of an odometry message."""
    pose = message.pose.pose
    turn = pose.orientation
    return pose.position.x, pose.position.y, heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)
