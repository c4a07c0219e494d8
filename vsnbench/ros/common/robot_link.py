"""The client's connection to a robot."""

import json
import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.errors import RobotError
from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import command_of, planar
from vsnbench.ros.common.readiness import Readiness
from vsnbench.sensing.exchange import Exchange
from vsnbench.sensing.path_orders import PathOrder, PathState
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot
from vsnbench.sensing.simulation import CATEGORIES, CONTACT, GROUND_TRUTH, INSTANCES
from vsnbench.sensing.steering import ZeroHold
from vsnbench.values.encoding.motion_answer import MotionCard
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

Found = TypeVar("Found")
_COLOR_FRAMES = 6
"""Number of colour images that a snapshot holds."""
MOST_FURTHER_IMAGES = 6
"""Number of images of each topic of a further camera."""
_LAST_MESSAGES_S = 0.05
"""Time in which the threads of the middleware send the last message."""


class RobotLink(ABC):
    """Subscriptions to a robot's topics, and the commands that a client sends; one per process.

    The threads of the middleware write to `RobotReports`.

    Attributes:
        kind: `ros1` or `ros2`, the kind of the robot's identity.
        profile: profile of the robot.
        names: interface of the profile, with full names of topics.
        image_turns: number of clockwise quarter turns that set an image upright.
        reports_lifting: whether the base has a topic that reports lifted wheels.
        exchange: topics and actions of other nodes.
        adapter: card of the motion adapter that moves the robot; None without one.
    """

    kind: str
    image_turns = 0
    reports_lifting = False
    adapter: MotionCard | None = None
    names: RosInterface
    exchange: Exchange
    _readiness: Readiness

    def __init__(self, profile: RobotProfile) -> None:
        self.profile = profile
        self._reports = RobotReports(profile)
        self._hold = ZeroHold(self.stand_still)
        self._path_state = PathState()

    def close(self) -> None:
        """Leave the network."""
        self._hold.release()
        time.sleep(_LAST_MESSAGES_S)
        self._disconnect()

    @property
    def others_drive(self) -> bool:
        """Whether a stack drives the robot, whose commands are expected."""
        return self._readiness.others_drive

    @others_drive.setter
    def others_drive(self, expected: bool) -> None:
        self._readiness.others_drive = expected

    def snapshot(self) -> RobotSnapshot:
        """Return the newest reports of the robot."""
        return self._reports.snapshot()

    def wait_for(self, condition: Callable[[RobotSnapshot], Found], timeout_s: float) -> Found:
        """Evaluate `condition` on every snapshot until its result is true; returns the last result."""
        return self._reports.wait_for(condition, timeout_s)

    def clear_events(self) -> None:
        """Drop the events so far; active hazard sensors stay active."""
        self._reports.clear_events()

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer; see `Readiness.missing_part`."""
        return self._readiness.missing_part(warned)

    def image(self, payload: Any) -> Any:
        """Return an image of a snapshot as a message that `sensing.images` reads."""
        return payload

    @property
    def holding(self) -> bool:
        """Whether zero velocity is held against other publishers."""
        return self._hold.holding

    def hold_still(self) -> None:
        """Command zero velocity, and stream it while another publisher drives the base."""
        self._hold.hold()

    def release(self) -> None:
        """Allow velocities of others again."""
        self._hold.release()

    def join_simulation(self) -> None:
        """Subscribe to the topics that only a simulated robot has."""
        self._subscribe_truth(self.names.simulation_topic(GROUND_TRUTH))
        self._subscribe_text(self.names.simulation_topic(CONTACT), self._reports.take_contact)
        if self.has_labels:
            self._subscribe_image(self.names.simulation_topic(INSTANCES), "labels", _COLOR_FRAMES)
            self._subscribe_text(self.names.simulation_topic(CATEGORIES), self._reports.take_categories)

    @property
    @abstractmethod
    def server(self) -> str:
        """What executes movements.

        `vsnbench` or `another` node of discrete_move, a motion `adapter`, or `workstation`, this process.
        """

    @property
    @abstractmethod
    def steer(self) -> Callable[[Command], None] | None:
        """Function that commands a velocity; None where a node of discrete_move steers the base."""

    @property
    @abstractmethod
    def can_be_placed(self) -> bool:
        """Whether the robot is simulated and can be put at a start."""

    @property
    @abstractmethod
    def has_labels(self) -> bool:
        """Whether the robot is simulated and labels its images."""

    @property
    @abstractmethod
    def now_s(self) -> float:
        """Time in which motions are measured: monotonic, or simulated where the network's time is simulated."""

    @property
    @abstractmethod
    def reports_outcomes(self) -> bool:
        """Whether a movement reports more than True or False."""

    @abstractmethod
    def command(self, command: Command) -> None:
        """Command a velocity, whatever executes movements."""

    def stand_still(self) -> None:
        """Command zero velocity."""
        self.command(STANDSTILL)

    @abstractmethod
    def drive(self, movement: Drive, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Execute one movement and return whether it succeeded.

        Args:
            movement: in the robot's frame.
            timeout_s: longest duration of the call.
            watch: called periodically; ends the movement by an exception.

        Raises:
            NoAnswerError: the node of discrete_move did not answer in time.
        """

    @property
    @abstractmethod
    def follows_paths(self) -> bool:
        """Whether what steers the base drives along paths that replace each other."""

    @property
    def path_state(self) -> PathState:
        """Newest state of what drives along paths."""
        return self._path_state

    def order_path(self, order: PathOrder) -> None:
        """Send an order, or repeat it, to what drives along paths."""
        self._publish_path(json.dumps(order.to_json()))

    @abstractmethod
    def _publish_path(self, text: str) -> None:
        """Publish an order on the topic of paths."""

    def _take_path_state(self, text: str) -> None:
        """Take the state of a node that drives along paths; errors are logged."""
        try:
            self._path_state = PathState.of(json.loads(text))
        except (ValueError, RecursionError) as error:
            logger.warning("%s_state is invalid: %s", self.names.paths, error)

    @property
    @abstractmethod
    def can_drive(self) -> bool:
        """Whether movements with parameters can be executed; upstream's server of discrete_move cannot."""

    @abstractmethod
    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot at a pose. Returns why the robot cannot be there, or an empty string."""

    @abstractmethod
    def begin_episode(self, timeout_s: float) -> None:
        """Report to the mover that an episode starts."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Close the node."""

    @abstractmethod
    def _subscribe_image(self, topic: str, field: str, capacity: int) -> None:
        """Store the images of a topic in a field of the snapshot, at most `capacity`."""

    @abstractmethod
    def _subscribe_camera_info(self, topic: str, take: Callable[[Any], None]) -> None:
        """Pass every sensor_msgs/CameraInfo of a topic to `take`."""

    @abstractmethod
    def _subscribe_text(self, topic: str, take: Callable[[str], None]) -> None:
        """Pass every text of a latched std_msgs/String topic to `take`."""

    @abstractmethod
    def _subscribe_truth(self, topic: str) -> None:
        """Pass every nav_msgs/Odometry of a topic to `take_truth`."""

    def _subscribe_camera(self) -> None:
        """Subscribe to the images and calibrations of the profile."""
        names = self.names
        self._subscribe_image(names.color, "colors", _COLOR_FRAMES)
        if names.depth:
            self._subscribe_image(names.depth, "depths", names.depth_frames + 2)
        for info, images in ((names.color_info, names.color), (names.depth_info, names.depth)):
            if info and images:
                self._subscribe_camera_info(info, partial(self._reports.take_camera_info, images))
        for role, topics in names.cameras.items():
            for info, images in ((topics.color_info, topics.color), (topics.depth_info, topics.depth)):
                if images and role in self.profile.cameras:
                    self._subscribe_image(images, "further", MOST_FURTHER_IMAGES)
                if images and info:
                    self._subscribe_camera_info(info, partial(self._reports.take_camera_info, images))

    def _take_command(self, twist: Any, sender: str, *, rival: bool) -> None:
        """Take a velocity of another node; a held base is commanded to stand still."""
        command = command_of(twist)
        if command != STANDSTILL:
            self._hold.answer()
        self._reports.take_command(sender, command, rival=rival)

    def _take_truth(self, message: Any, stamp_s: float) -> None:
        """Take the pose of a simulated robot in its site."""
        self._reports.take_truth(planar(message), stamp_s)


def placement_seed(seed: int) -> int:
    """Return a seed as a non-negative 63-bit integer, which every message type holds."""
    return seed & 0x7FFF_FFFF_FFFF_FFFF
