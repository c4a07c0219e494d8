"""The client's connections to a robot: what its topics last said, a way to command zero velocity, its services.

Messages are kept as they came and decoded only when they are looked at. Imported only where ROS is installed.
"""

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.hazard_events import subscribe_hazard
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master
from vsnbench.ros1.messages import DiscreteServer, DiscreteServerRequest, PlaceRobot, PlaceRobotRequest
from vsnbench.ros1.node import now_s, start_node
from vsnbench.ros1.service_call import ServiceClient
from vsnbench.ros1.simulated_topics import CATEGORIES, CONTACT, GROUND_TRUTH, INSTANCES, PLACE
from vsnbench.sensing.discrete_mover import Hazard, Outcome
from vsnbench.sensing.odometry import OdometryReading, OdometryTracker, heading_of_quaternion
from vsnbench.sensing.pairing import Stamped

NODE = "vsnbench"
_COLOR_FRAMES = 6
_IMAGE_BUFFER = 1 << 24


class RobotLink:
    """Everything that a client hears from a robot and can ask of it; one a process.

    `news` is notified with every message; hold it to read several things that belong together.
    """

    def __init__(self, profile: RobotProfile) -> None:
        names = ros1_interface(profile)
        self.news = threading.Condition()
        self.tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
        self.readings: deque[OdometryReading] = deque(maxlen=max(10, round(2 * profile.base.odometry_rate_hz)))
        self.odometry_fault = ""
        self.colors: deque[Stamped[Any]] = deque(maxlen=_COLOR_FRAMES)
        self.depths: deque[Stamped[Any]] = deque(maxlen=names.depth_frames + 2)
        self.labels: deque[Stamped[Any]] = deque(maxlen=_COLOR_FRAMES)
        self.categories: Mapping[int, str] = {}
        self.hazards: dict[Hazard, set[int]] = {hazard: set() for hazard in Hazard}
        self.hazard_events: list[tuple[Hazard, str]] = []
        self.contact = ""
        """What a simulated robot touches, or has touched since `clear_hazards`."""
        self.truth: Stamped[Pose] | None = None
        self.outcome: Outcome | None = None
        self.commanded_s = 0.0
        """When somebody else last commanded a velocity (monotonic clock)."""

        self.master: Master = start_node(NODE)
        self.names = names
        self.discrete_move = ServiceClient(names.discrete_move, DiscreteServer, self.master, self.master.caller)
        self._reset = ServiceClient(f"{names.discrete_move}/reset", Trigger, self.master, self.master.caller)
        self._place = ServiceClient(PLACE, PlaceRobot, self.master, self.master.caller)
        self._commands = rospy.Publisher(names.command, Twist, queue_size=10, tcp_nodelay=True)
        self._reset_odometry = (
            rospy.Publisher(names.reset_odometry, Empty, queue_size=1) if names.reset_odometry else None
        )
        self._subscribe(profile)

    def close(self) -> None:
        """Leave the ROS network."""
        # What was published last leaves through rospy's own threads.
        time.sleep(0.05)
        rospy.signal_shutdown("closed")

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
    def tells_outcomes(self) -> bool:
        """Whether the server of discrete_move is ours, which says more than its answer's bool."""
        return bool(self._outcomes.get_num_connections())

    def join_simulation(self) -> None:
        """Listen to what only a simulated robot tells."""
        rospy.Subscriber(GROUND_TRUTH, Odometry, self._on_truth, queue_size=5, tcp_nodelay=True)
        rospy.Subscriber(CONTACT, String, self._on_contact, queue_size=20, tcp_nodelay=True)
        if self.has_labels:
            self._subscribe_image(INSTANCES, self.labels)
            rospy.Subscriber(CATEGORIES, String, self._on_categories, queue_size=1)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `condition()` holds, looked at with every message; False when it never did.

        `news` is held while `condition` is asked.
        """
        with self.news:
            return self.news.wait_for(condition, timeout_s)

    def stand_still(self) -> None:
        """Command zero velocity."""
        self._commands.publish(Twist())

    def move(self, movement: str, angle_deg: int, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Ask discrete_move for one movement and return its answer; see `ServiceClient.call` for what it raises."""
        with self.news:
            self.outcome = None
        request = DiscreteServerRequest(movement, angle_deg)
        return bool(self.discrete_move.call(request, timeout_s, watch).response)

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot down; returns why it cannot stand there, empty when it does."""
        seed_63 = seed & 0x7FFF_FFFF_FFFF_FFFF
        answer = self._place.call(PlaceRobotRequest(pose.x_m, pose.y_m, pose.heading_rad, seed_63), timeout_s)
        return "" if answer.success else str(answer.message)

    def begin_episode(self, timeout_s: float) -> None:
        """Tell base and discrete_move that an episode starts here, as far as they can be told."""
        if self._reset_odometry is not None:
            self._reset_odometry.publish(Empty())
        if f"{self.names.discrete_move}/reset" in self.master.state().services:
            self._reset.call(Trigger._request_class(), timeout_s)  # noqa: SLF001

    def clear_hazards(self) -> None:
        """Forget what has happened; what is pressed stays known."""
        with self.news:
            self.hazard_events.clear()
            self.odometry_fault = ""
            self.contact = ""

    def _subscribe(self, profile: RobotProfile) -> None:
        names = ros1_interface(profile)
        rospy.Subscriber(names.odometry, Odometry, self._on_odometry, queue_size=20, tcp_nodelay=True)
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=20, tcp_nodelay=True)
        for topic, store in ((names.color, self.colors), (names.depth, self.depths)):
            if topic:
                self._subscribe_image(topic, store)
        for hazard in Hazard:
            subscribe_hazard(names, hazard, self._on_hazard)
        self._outcomes = rospy.Subscriber(
            f"{names.discrete_move}/outcome", String, self._on_outcome, queue_size=5, tcp_nodelay=True
        )

    def _subscribe_image(self, topic: str, store: "deque[Stamped[Any]]") -> None:
        def on_image(message: Any) -> None:
            with self.news:
                store.append(Stamped(message, message.header.stamp.to_sec(), time.monotonic()))
                self.news.notify_all()

        rospy.Subscriber(topic, Image, on_image, queue_size=5, buff_size=_IMAGE_BUFFER, tcp_nodelay=True)

    def _on_odometry(self, message: Any) -> None:
        pose, arrival_s = _planar(message), time.monotonic()
        with self.news:
            fault = self.tracker.add(*pose, message.header.stamp.to_sec(), arrival_s)
            if fault:
                self.odometry_fault = fault
            elif self.tracker.latest is not None:
                self.readings.append(self.tracker.latest)
            self.news.notify_all()

    def _on_command(self, message: Any) -> None:
        if message._connection_header.get("callerid") != self.master.caller:  # noqa: SLF001
            self.commanded_s = time.monotonic()

    def _on_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        with self.news:
            if active:
                self.hazards[hazard].add(sensor)
                self.hazard_events.append((hazard, where))
            else:
                self.hazards[hazard].discard(sensor)
            self.news.notify_all()

    def _on_contact(self, message: Any) -> None:
        if message.data:
            with self.news:
                self.contact = message.data
                self.news.notify_all()

    def _on_truth(self, message: Any) -> None:
        with self.news:
            self.truth = Stamped(Pose(*_planar(message)), message.header.stamp.to_sec(), time.monotonic())
            self.news.notify_all()

    def _on_outcome(self, message: Any) -> None:
        with self.news:
            self.outcome = Outcome(**json.loads(message.data))
            self.news.notify_all()

    def _on_categories(self, message: Any) -> None:
        with self.news:
            self.categories = {int(number): str(name) for number, name in json.loads(message.data).items()}
            self.news.notify_all()


def _planar(message: Any) -> tuple[float, float, float]:
    """Return x, y and heading of an odometry message."""
    pose = message.pose.pose
    turn = pose.orientation
    return pose.position.x, pose.position.y, heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)
