"""The client's connections to a robot on a ROS 2 graph: what its topics report, velocities, its movements.

Movements are carried out by a discrete_move node beside the base where there is one, else by this process.
Imported only where ROS 2 is installed.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import String

from vsnbench.errors import NoAnswerError, RobotError
from vsnbench.motion.controller import STANDSTILL, Command
from vsnbench.motion.discrete_move_settings import motion_settings
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import ROS2
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros2.docking import Dock, subscribe_dock
from vsnbench.ros2.graph import Graph
from vsnbench.ros2.hazard_events import subscribe_hazards
from vsnbench.ros2.interface import ros2_interface
from vsnbench.ros2.messages import image_of_serialized, planar, seconds, stamp_of_serialized
from vsnbench.ros2.node import LATCHED, SENSOR_DATA, Ros2Node
from vsnbench.ros2.questions import Asker
from vsnbench.ros2.readiness import missing_part
from vsnbench.ros2.velocities import Velocities
from vsnbench.sensing.discrete_mover import DiscreteMover, Hazard, Outcome
from vsnbench.sensing.odometry import OdometryTracker
from vsnbench.sensing.robot_reports import RobotReports
from vsnbench.sensing.simulation import ACCOUNT, CATEGORIES, CONTACT, GROUND_TRUTH, INSTANCES, PLACE

_COLOR_FRAMES = 6


class RobotLink:
    """Everything that a client hears from a robot and can ask of it; one a process.

    Messages come in the thread that spins and go to its RobotReports; images as bytes.
    """

    kind = ROS2
    tells_of_lifting = False

    def __init__(self, profile: RobotProfile, parameters: ProtocolParameters) -> None:
        self.profile_name = profile.name
        self.names = names = ros2_interface(profile)
        self.image_turns = names.image_turns
        self._parameters = parameters
        self._reports = RobotReports(profile)
        self.snapshot = self._reports.snapshot
        self.wait_for = self._reports.wait_for
        self.clear_events = self._reports.clear_events
        self.node = Ros2Node(f"vsnbench_{time.time_ns() // 1_000_000}", names.root)
        try:
            self.graph = Graph(self.node)
            self.velocities = Velocities(self.node, self.graph, names, self._on_command)
            self._holding = threading.Event()
            self._beside_base = Asker(self.node, names.discrete_move)
            self._place = Asker(self.node, names.resolve(PLACE.lstrip("/")))
            self._server = ""
            self._mover = DiscreteMover(
                self._steer,
                motion_settings(profile),
                OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s),
                self.node.now_s,
                self.node.sleep_until,
            )
            self._subscribe()
        except BaseException:
            self.node.close()
            raise

    def close(self) -> None:
        """Leave the graph."""
        # What was published last leaves through the middleware's own threads.
        time.sleep(0.05)
        self.node.close()

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer and what to do about it; None when all do."""
        account = self.snapshot().simulation
        self.node.follow_simulated_time(simulated=account is not None and account.rate_factor != 1)
        return missing_part(self, warned)

    @property
    def server(self) -> str:
        """Who carries out movements: `vsnbench`, the node beside the base, or `workstation`, this process."""
        return self._server

    @property
    def can_be_placed(self) -> bool:
        """Whether the robot is a simulated one that can be put where it should start."""
        return self.snapshot().simulation is not None

    @property
    def has_labels(self) -> bool:
        """Whether the robot is a simulated one that labels what its camera sees."""
        return bool(self.graph.publishers(self._own(INSTANCES)))

    @property
    def now_s(self) -> float:
        """The time that motions are measured in: monotonic, or simulated where a simulator is the clock."""
        return self.node.now_s()

    @property
    def reports_outcomes(self) -> bool:
        """Whether a movement's outcome comes with more than its answer: always."""
        return True

    @property
    def holding(self) -> bool:
        """Whether the base is held still against others."""
        return self._holding.is_set()

    def image(self, payload: Any) -> Any:
        """Return an image of a snapshot as a message."""
        return image_of_serialized(payload)

    def join_simulation(self) -> None:
        """Listen to what only a simulated robot reports."""
        listen = self.node.rclpy.create_subscription
        listen(Odometry, self._own(GROUND_TRUTH), self._on_truth, SENSOR_DATA)
        listen(String, self._own(CONTACT), lambda message: self._reports.take_contact(message.data), LATCHED)
        if self.has_labels:
            self._subscribe_image(self._own(INSTANCES), "labels", _COLOR_FRAMES)
            listen(String, self._own(CATEGORIES), lambda m: self._reports.take_categories(m.data), LATCHED)

    def stand_still(self) -> None:
        """Command zero velocity."""
        self.velocities.send(STANDSTILL)

    def hold_still(self) -> None:
        """Command zero velocity, whatever our own movement commands, and answer everybody else's with zero at once."""
        self._holding.set()
        self.stand_still()

    def release(self) -> None:
        """Let others steer again."""
        self._holding.clear()

    def move(self, movement: str, angle_deg: int, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Have one movement carried out and return its answer; `watch` may raise to end it.

        Raises:
            NoAnswerError: the node beside the base does not answer in time.
        """
        self._reports.take_outcome(None)
        distance_m = self._parameters.forward_m
        if self._server == "vsnbench":
            asked = {"movement": movement, "angle_deg": angle_deg, "distance_m": distance_m}
            said = self._beside_base.ask(asked, timeout_s, watch)
            try:
                outcome = Outcome(**said)
            except TypeError as error:
                raise NoAnswerError(
                    f"{self.names.discrete_move} is of another version of vsnbench",
                    advice="run the same on both machines",
                ) from error
        else:
            outcome = self._mover.carry_out(movement, angle_deg, _never_gone(watch), distance_m)
        self._reports.take_outcome(outcome)
        return outcome.answer

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot down; returns why it cannot stand there, empty when it does."""
        seed_63 = seed & 0x7FFF_FFFF_FFFF_FFFF
        where = {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad, "seed": seed_63}
        said = self._place.ask(where, timeout_s)
        return str(said.get("problem", "the simulator gave no answer that this version understands"))

    def begin_episode(self, timeout_s: float) -> None:
        """Tell whoever carries out movements that an episode starts here."""
        self._mover.forget_heading()
        if self._server == "vsnbench":
            self._beside_base.ask({"movement": "Reset"}, timeout_s)

    def choose_server(self) -> RobotError | None:
        """Find out, once a session, who carries out movements; returns why nobody can, None when somebody does.

        A node beside the base that the graph knows has to answer, and to have found the base; afterwards the choice
        stands.
        """
        expected = bool(self.graph.subscribers(f"{self.names.discrete_move}/question"))
        if self._server == "workstation" or not (expected or self._server):
            self._server = "workstation"
            return None
        try:
            missing = self._beside_base.ask({"movement": "Ping"}, 1.0).get("missing", "")
        except NoAnswerError as error:
            start = f"(vsnbench ros2 discrete-move --robot {self.profile_name})"
            return NoAnswerError(error.statement, advice=f"{error.advice} {start}".strip())
        if missing:
            return RobotError(f"{self.names.discrete_move} is up and cannot move the base: {missing}")
        self._server = "vsnbench"
        return None

    def _steer(self, command: Command) -> None:
        # Who holds the base still need not wait until this process's own movement has heard of it.
        self.velocities.send(STANDSTILL if self._holding.is_set() else command)
        self._reports.take_own_command()

    def _own(self, topic: str) -> str:
        """Return a topic of the simulation in this robot's namespace."""
        return self.names.resolve(topic.lstrip("/"))

    def _subscribe(self) -> None:
        names, listen = self.names, self.node.rclpy.create_subscription
        listen(Odometry, names.odometry, self._on_odometry, SENSOR_DATA)
        self._subscribe_image(names.color, "colors", _COLOR_FRAMES)
        if names.depth:
            self._subscribe_image(names.depth, "depths", names.depth_frames + 2)
        listen(String, self._own(ACCOUNT), lambda message: self._reports.take_account(message.data), LATCHED)
        self.unheard = subscribe_hazards(self.node, names, self._on_hazard)
        self.dock = Dock(self.profile_name, names)
        subscribe_dock(self.node, names, self.dock, self._on_battery)

    def _subscribe_image(self, topic: str, field: str, most: int) -> None:
        def on_image(data: bytes, info: Any) -> None:
            sender = self.graph.sender(topic, info)
            self._reports.take_image(field, most, data, stamp_of_serialized(data), topic, sender)

        self.node.rclpy.create_subscription(Image, topic, on_image, SENSOR_DATA, raw=True)

    def _on_odometry(self, message: Any, info: Any) -> None:
        stamp_s, pose = seconds(message.header.stamp), planar(message)
        self._mover.take_odometry(*pose, stamp_s)
        self._reports.take_odometry(pose, stamp_s, self.names.odometry, self.graph.sender(self.names.odometry, info))

    def _on_command(self, twist: Any, sender: str) -> None:
        moves = any((twist.linear.x, twist.linear.y, twist.angular.z))
        if moves and self._holding.is_set():
            self.stand_still()
        self._reports.take_command(sender, moves=moves)

    def _on_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        self._mover.take_hazard(hazard, sensor, active, where)
        self._reports.take_hazard(hazard, sensor, active, where)

    def _on_battery(self, message: Any) -> None:
        self._reports.take_battery(Battery.reported(message.percentage, message.voltage))

    def _on_truth(self, message: Any) -> None:
        self._reports.take_truth(planar(message), seconds(message.header.stamp))


def _never_gone(watch: Callable[[], None] | None) -> Callable[[], bool]:
    """Return what the mover asks all the while: this process is its own caller, and only its watch ends a movement."""

    def gone() -> bool:
        if watch is not None:
            watch()
        return False

    return gone
