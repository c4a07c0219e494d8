"""The discrete_move node: executes movements on the robot itself."""

import json
import logging
import threading
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import DecisionError
from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import moves
from vsnbench.ros.common.node import NodeTask
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.sensing.path_driver import PathDriver
from vsnbench.sensing.path_orders import PathOrder
from vsnbench.sensing.steering import rival_text
from vsnbench.values.decision_check import checked_movement
from vsnbench.values.encoding.codec import movement_from_json
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive, Move, Pixel
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

NODE = "discrete_move"
_CLOSING = "discrete_move is shutting down"
_LONGEST_ORDER = 20_000
"""Longest order of a path, characters."""


def mover_of(
    profile: RobotProfile,
    settings: MotionSettings,
    send: Callable[[Command], None],
    now_s: Callable[[], float],
    sleep_until: Callable[[float], None],
) -> Mover:
    """Return the mover of a base."""
    tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
    return Mover(send, settings, tracker, now_s, sleep_until)


class DiscreteMoveTask(NodeTask):
    """Executes movements for one robot until it is closed; subclasses connect it to a middleware."""

    def __init__(self, names: RosInterface, mover: Mover) -> None:
        self._command_topic = names.command
        self._mover = mover
        self._paths = PathDriver(mover)
        self._closed = threading.Event()
        self._odometry_arrived = threading.Event()

    @abstractmethod
    def send(self, command: Command) -> None:
        """Publish a velocity."""

    def close(self) -> None:
        """Command zero velocity and answer False to waiting callers; may be called more than once."""
        if not self._closed.is_set():
            self._closed.set()
            self._mover.stop(_CLOSING)
            self.send(STANDSTILL)

    def drive(self, movement: Drive, caller_gone: Callable[[], bool]) -> MotionResult:
        """Execute one movement to its end and log its result; see `Mover.drive`."""
        if self._closed.is_set():
            return MotionResult(completed=False, failure=_CLOSING)
        result = self._mover.drive(movement, caller_gone)
        if not result.completed:
            return self.refuse(movement.text, result)
        logger.info("%s: done in %.2f s", movement.text, result.duration_s)
        return result

    def drive_json(self, content: Any, caller_gone: Callable[[], bool]) -> MotionResult:
        """Execute the movement in JSON of `MovementBase.to_json`, from the network; see `drive`."""
        try:
            movement = movement_from_json(content)
            checked = checked_movement(movement)
        except (ValueError, DecisionError) as error:
            return self.refuse("drive", f"cannot read the movement: {error}")
        if isinstance(checked, Pixel):
            return self.refuse("drive", "a pixel must be resolved to a waypoint first")
        if isinstance(checked, Move) and movement.holds_heading:
            checked = replace(checked, holds_heading=True)
        return self.drive(checked, caller_gone)

    def take_path(self, text: str) -> str:
        """Take an order of `sensing.path_orders` from the network, or its repetition; return the state as JSON."""
        state = self._paths.state
        try:
            order = PathOrder.of(json.loads(text) if len(text) <= _LONGEST_ORDER else None)
        except (ValueError, RecursionError) as error:
            self._warn(f"ignored an order: {error}")
        else:
            if not self._closed.is_set():
                state = self._paths.take(order)
        return json.dumps(state.to_json())

    def refuse(self, movement: str, failure: str | MotionResult) -> MotionResult:
        """Log why a movement failed, and return its result."""
        result = MotionResult(completed=False, failure=failure) if isinstance(failure, str) else failure
        self._warn(f"{movement}: failed: {result.failure}")
        return result

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
