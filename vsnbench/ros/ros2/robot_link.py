"""The client's connection to a robot over ROS 2.

A discrete_move node on the robot executes movements if there is one, else this process does.
"""

import time
from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import String

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.discrete_move_settings import motion_settings
from vsnbench.errors import NoAnswerError, RobotError
from vsnbench.ros.common.discrete_move import mover_of
from vsnbench.ros.common.robot_link import RobotLink, placement_seed
from vsnbench.ros.ros2.docking import Dock, subscribe_dock
from vsnbench.ros.ros2.exchange import Ros2Exchange
from vsnbench.ros.ros2.graph import Graph
from vsnbench.ros.ros2.hazard_events import subscribe_hazards
from vsnbench.ros.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.ros.ros2.messages import CompressedBytes, image_of_serialized, seconds, stamp_of_serialized
from vsnbench.ros.ros2.node import LATCHED, SENSOR_DATA, Ros2Node
from vsnbench.ros.ros2.readiness import Ros2Readiness, card_of_mover
from vsnbench.ros.ros2.subscriptions import Ros2Odometry
from vsnbench.ros.ros2.topic_service import ANSWER_S, TopicServiceClient
from vsnbench.ros.ros2.velocities import Velocities
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.images.compressed_images import is_compressed
from vsnbench.sensing.path_driver import PathDriver
from vsnbench.sensing.path_orders import PathOrder, PathState
from vsnbench.sensing.simulation import ACCOUNT, INSTANCES, PLACE
from vsnbench.values.battery import Battery
from vsnbench.values.encoding.motion_answer import result_of_answer
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import ROS2
from vsnbench.values.robot_profile import RobotProfile

_ON_ROBOT, _ADAPTER, _WORKSTATION = "vsnbench", "adapter", "workstation"
"""Values of `RobotLink.server`."""


class Ros2Link(RobotLink):
    """Connection to a robot on a ROS 2 graph; one per process.

    Messages arrive in the thread of the node. Images stay serialized.
    """

    kind = ROS2
    can_drive = True
    reports_outcomes = True
    names: Ros2Interface

    def __init__(self, profile: RobotProfile) -> None:
        super().__init__(profile)
        self.names = names = ros2_interface(profile)
        self.image_turns = names.image_turns
        self.node = Ros2Node(f"vsnbench_{time.time_ns() // 1_000_000}", names.root)
        try:
            self.graph = Graph(self.node)
            self.exchange = Ros2Exchange(self.node, self.graph)
            self.velocities = Velocities(self.node, self.graph, names, self._on_command)
            self._discrete_move = TopicServiceClient(self.node, names.discrete_move)
            self._place = TopicServiceClient(self.node, names.simulation_topic(PLACE))
            self._server = ""
            self._is_commanded = False
            settings = motion_settings(profile)
            self._mover = mover_of(profile, settings, self._steer, self.node.now_s, self.node.sleep_until)
            self._paths = PathDriver(self._mover)
            self._publish_order = self.node.text_publisher(names.paths)
            self.node.subscribe_text(f"{names.paths}_state", self._take_path_state)
            self._subscribe()
        except BaseException:
            self.node.close()
            raise

    def _disconnect(self) -> None:
        self.node.close()

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer; see `Readiness.missing_part`."""
        account = self.snapshot().simulation
        self.node.follow_simulated_time(simulated=account is not None and account.rate_factor != 1)
        return super().missing_part(warned)

    @property
    def server(self) -> str:
        """What executes movements: `vsnbench`, the node on the robot; an `adapter`; or `workstation`, this process."""
        return self._server

    @property
    def steer(self) -> Callable[[Command], None] | None:
        """Function that commands a velocity; None where the node on the robot steers the base."""
        return self.command if self._server == _WORKSTATION else None

    @property
    def can_be_placed(self) -> bool:
        """Whether the robot is simulated and can be put at a start."""
        return self.snapshot().simulation is not None

    @property
    def has_labels(self) -> bool:
        """Whether the robot is simulated and labels its images."""
        return bool(self.graph.publishers(self.names.simulation_topic(INSTANCES)))

    @property
    def now_s(self) -> float:
        """Time in which motions are measured: monotonic, or simulated where a simulator publishes the time."""
        return self.node.now_s()

    def image(self, payload: Any) -> Any:
        """Return an image of a snapshot as a message."""
        return image_of_serialized(payload)

    def command(self, command: Command) -> None:
        """Command a velocity, whatever executes movements."""
        was_commanded, self._is_commanded = self._is_commanded, command != STANDSTILL
        if was_commanded or self._is_commanded:  # a base rolls on until the zero that ends other velocities
            self._mover.take_other_command()
        self.velocities.send(command)

    def drive(self, movement: Drive, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Execute one movement and return whether it succeeded; `watch` may raise to end it.

        Raises:
            NoAnswerError: the node on the robot does not answer in time.
        """
        self._reports.take_outcome(None)
        if self._server in (_ON_ROBOT, _ADAPTER):
            result = self._ask_robot(movement, timeout_s, watch)
        else:
            result = self._mover.drive(movement, _never_gone(watch), timeout_s)
        self._reports.take_outcome(result)
        return result.completed

    @property
    def follows_paths(self) -> bool:
        """Whether this process or a node of vsnbench steers the base; no motion adapter takes orders of paths."""
        if self._server == _WORKSTATION:
            return bool(self.names.command)
        return self._server == _ON_ROBOT and bool(self.graph.publishers(f"{self.names.paths}_state"))

    def order_path(self, order: PathOrder) -> None:
        """Send an order, or repeat it, to what drives along paths."""
        if self._server == _WORKSTATION:
            self._path_state = self._paths.take(order)
        else:
            super().order_path(order)

    def _publish_path(self, text: str) -> None:
        self._publish_order(text)

    @property
    def path_state(self) -> PathState:
        """Newest state of what drives along paths."""
        return self._paths.state if self._server == _WORKSTATION else self._path_state

    def _ask_robot(self, movement: Drive, timeout_s: float, watch: Callable[[], None] | None) -> MotionResult:
        deadline_s = timeout_s - ANSWER_S if timeout_s > ANSWER_S else timeout_s / 2
        request = {"request": "drive", "movement": movement.to_json(), "deadline_s": deadline_s}
        answer = self._discrete_move.call(request, timeout_s, watch)
        try:
            return result_of_answer(answer)
        except ValueError as error:
            raise NoAnswerError(
                f"the answer of {self.names.discrete_move} cannot be read: {error}",
                advice="run the same version of vsnbench on both machines, or correct the adapter",
                code="version-mismatch",
            ) from error

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot at a pose. Returns why the robot cannot be there, or an empty string."""
        request = {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad, "seed": placement_seed(seed)}
        answer = self._place.call(request, timeout_s)
        return str(answer.get("problem", "the simulator's answer does not fit this version of vsnbench"))

    def begin_episode(self, timeout_s: float) -> None:
        """Reset the held heading of the mover."""
        self._mover.forget_heading()
        if self._server in (_ON_ROBOT, _ADAPTER):
            self._discrete_move.call({"request": "reset"}, timeout_s)

    def choose_server(self) -> RobotError | None:
        """Select what executes movements, once per session; returns why nothing can, or None.

        A discrete_move node on the graph has to answer, and to have found the base.
        """
        expected = bool(self.graph.subscribers(f"{self.names.discrete_move}/question"))
        if not self.names.command and not (expected or self._server):
            return RobotError(
                f"no motion adapter serves {self.names.discrete_move}, and the profile names no topic for velocities",
                advice="start the adapter in this domain, or name interface.command",
                code="no-adapter",
            )
        if self._server == _WORKSTATION or not (expected or self._server):
            self._server = _WORKSTATION
            return None
        try:
            self.adapter = card_of_mover(self._discrete_move, 1.0)
        except NoAnswerError as error:
            start = f"(vsnbench robots serve {self.profile.argument})" if self.names.command else ""
            return NoAnswerError(error.statement, advice=f"{error.advice} {start}".strip())
        except RobotError as error:
            return error
        self._server = _ADAPTER if self.adapter else _ON_ROBOT
        return None

    def _subscribe_image(self, topic: str, field: str, capacity: int) -> None:
        compressed = is_compressed(topic)

        def on_image(data: bytes, info: Any) -> None:
            sender, image = self.graph.sender(topic, info), CompressedBytes(data) if compressed else data
            self._reports.take_image(field, capacity, image, stamp_of_serialized(data), topic, sender)

        kind = CompressedImage if compressed else Image
        self.node.rclpy.create_subscription(kind, topic, on_image, SENSOR_DATA, raw=True)

    def _subscribe_camera_info(self, topic: str, take: Callable[[Any], None]) -> None:
        self.node.rclpy.create_subscription(CameraInfo, topic, take, SENSOR_DATA)

    def _subscribe_text(self, topic: str, take: Callable[[str], None]) -> None:
        self.node.rclpy.create_subscription(String, topic, lambda message: take(message.data), LATCHED)

    def _subscribe_truth(self, topic: str) -> None:
        def on_truth(message: Any) -> None:
            self._take_truth(message, seconds(message.header.stamp))

        self.node.rclpy.create_subscription(Odometry, topic, on_truth, SENSOR_DATA)

    def _steer(self, command: Command) -> None:
        # A hold takes effect at once, before the movement of this process has noticed it.
        self.velocities.send(STANDSTILL if self._hold.holding else command)
        self._reports.take_own_command()

    def _subscribe(self) -> None:
        names = self.names
        self.odometry = Ros2Odometry(self.node, names, self._on_odometry, self._reports.take_attitude)
        self._subscribe_camera()
        self._subscribe_text(names.simulation_topic(ACCOUNT), self._reports.take_account)
        subscribe_hazards(self.node, names, self._on_hazard)
        dock = Dock(self.profile, names)
        subscribe_dock(self.node, names, dock, self._on_battery)
        self._readiness = Ros2Readiness(
            names,
            self.snapshot,
            lambda: self.odometry.fault,
            self.profile,
            node=self.node,
            graph=self.graph,
            connect=self.velocities.connect,
            choose_server=self.choose_server,
            dock=dock,
        )

    def _on_odometry(self, pose: tuple[float, float, float], stamp_s: float, info: Any) -> None:
        topic = self.names.odometry_topic
        self._mover.take_odometry(*pose, stamp_s)
        self._reports.take_odometry(pose, stamp_s, topic, self.graph.sender(topic, info))

    def _on_command(self, twist: Any, sender: str) -> None:
        # The node on the robot detects rivals itself; a sender that is not known yet may be that node.
        name = sender.partition(" (no. ")[0].rpartition("/")[2]
        is_ours = self._server == _ON_ROBOT and name in ("", "discrete_move")
        self._take_command(twist, sender or "another node", rival=not is_ours)

    def _on_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        self._mover.take_hazard(hazard, sensor, active, where)
        self._reports.take_hazard(hazard, sensor, active, where)

    def _on_battery(self, message: Any) -> None:
        self._reports.take_battery(Battery.reported(message.percentage, message.voltage))


def _never_gone(watch: Callable[[], None] | None) -> Callable[[], bool]:
    """Return the mover's check of its caller: this process is always there, and `watch` may raise."""

    def gone() -> bool:
        if watch is not None:
            watch()
        return False

    return gone
