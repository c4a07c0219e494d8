"""The discrete_move node: executes movements on the robot itself."""

import logging
import threading
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import DecisionError
from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import moves
from vsnbench.ros.common.node import NodeTask
from vsnbench.sensing.discrete_mover import DiscreteMover
from vsnbench.sensing.movements import Outcome
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.sensing.steering import rival_text
from vsnbench.values.movement import Pixel, checked_movement, movement_from_json
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

NODE = "discrete_move"


def mover_of(
    profile: RobotProfile,
    settings: MotionSettings,
    send: Callable[[Command], None],
    now_s: Callable[[], float],
    sleep_until: Callable[[float], None],
) -> DiscreteMover:
    """Return the mover of a base."""
    tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
    return DiscreteMover(send, settings, tracker, now_s, sleep_until)


class DiscreteMoveTask(NodeTask):
    """Executes movements for one robot until it is closed; subclasses connect it to a middleware."""

    def __init__(self, names: RosInterface, mover: DiscreteMover) -> None:
        self._command_topic = names.command
        self._mover = mover
        self._closed = threading.Event()
        self._odometry_arrived = threading.Event()

    @abstractmethod
    def send(self, command: Command) -> None:
        """Publish a velocity."""

    def close(self) -> None:
        """Command zero velocity and answer False to waiting callers; may be called more than once."""
        if not self._closed.is_set():
            self._closed.set()
            self._mover.stop("discrete_move is shutting down")
            self.send(STANDSTILL)

    def execute(
        self, movement: str, angle_deg: int, caller_gone: Callable[[], bool], distance_m: float | None = None
    ) -> Outcome:
        """Execute one movement to its end and log its outcome; see `DiscreteMover.carry_out`."""
        if self._closed.is_set():
            return Outcome(movement, False, "discrete_move is shutting down")
        return self._logged(self._mover.carry_out(movement, angle_deg, caller_gone, distance_m))

    def drive(self, content: Any, caller_gone: Callable[[], bool]) -> Outcome:
        """Execute a movement with parameters to its end and log its outcome.

        Args:
            content: JSON of `movement_to_json`, from the network.
            caller_gone: returns whether the caller has disconnected, which ends the movement.
        """
        if self._closed.is_set():
            return Outcome("drive", False, "discrete_move is shutting down")
        try:
            movement = checked_movement(movement_from_json(content))
        except (ValueError, DecisionError) as error:
            return self._logged(Outcome("drive", False, f"cannot read the movement: {error}"))
        if isinstance(movement, Pixel):
            return self._logged(Outcome("drive", False, "a pixel must be resolved to a waypoint first"))
        return self._logged(self._mover.drive(movement, caller_gone))

    def _logged(self, outcome: Outcome) -> Outcome:
        if outcome.answer:
            logger.info("%s: done in %.2f s", outcome.movement, outcome.duration_s)
        else:
            self._warn(f"{outcome.movement}: failed: {outcome.reason}")
        return outcome

    def _warn(self, text: str) -> None:
        """Log why a movement failed."""
        logger.warning("%s", text)

    def take_odometry(self, pose: tuple[float, float, float], stamp_s: float, _sender: Any) -> None:
        """Take the odometry of the base: metres, radians, seconds."""
        self._mover.take_odometry(*pose, stamp_s)
        self._odometry_arrived.set()

    def take_foreign_command(self, twist: Any, sender: str) -> None:
        """Take a velocity that another node published on the command topic."""
        if moves(twist):
            self._mover.take_rival(rival_text(sender or "another node", self._command_topic))
