"""Measures where a robot is at its mark: looks, turns around, and begins the episode from the measured pose.

The operator receives a `Placing` with each request to place the robot, and uses it in the thread of the request.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError
from vsnbench.files.atomic import write_atomic
from vsnbench.localization.looks import DepthLook
from vsnbench.localization.matching import PlacementMatcher
from vsnbench.localization.overlay import ghost, laid_over
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.encoding.images import encode_jpeg, encode_png
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.placement import MeasuredPlacement
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)

_PUSHED_M, _PUSHED_RAD = 0.01, 0.01
"""If the odometry has changed by more since the measurement, the robot is measured again."""


@dataclass(frozen=True, eq=False)
class PlacementLook:
    """The robot's view at its mark, and the pose measured from it."""

    site: Site
    mark: Pose
    observation: Observation | None
    """The last observation; None if there is none."""
    measured: MeasuredPlacement | None = None
    """None if nothing could be measured."""
    problem: str = ""
    """Why there is no observation or no measurement."""
    photo_jpeg: bytes | None = None
    """Image from when this robot was first accepted at this mark; None if there is none."""

    @property
    def rgb(self) -> npt.NDArray[np.uint8] | None:
        """The robot's view, (H, W, 3)."""
        return None if self.observation is None else self.observation.rgb

    @cached_property
    def picture_jpeg(self) -> bytes | None:
        """The robot's view, as JPEG."""
        return None if self.rgb is None else encode_jpeg(self.rgb)

    @cached_property
    def ghost_png(self) -> bytes | None:
        """Edges of the expected view from the mark, as a transparent PNG of the same size."""
        if self.observation is None:
            return None
        return encode_png(ghost(self.site, self.observation.camera, self.mark))

    def write_overlay(self, path: Path) -> None:
        """Write the robot's view with the edges of the expected view, as PNG.

        Raises:
            RobotError: there is no view.
            RecordError: the file cannot be written.
        """
        if self.observation is None:
            raise RobotError(f"there is no image: {self.problem}")
        observation = self.observation
        over = laid_over(observation.rgb, ghost(self.site, observation.camera, self.mark))
        solid = np.full((*over.shape[:2], 1), 255, np.uint8)
        write_atomic(path, encode_png(np.concatenate([over, solid], axis=2)))


class Placing:
    """Placement of a robot at the start of an episode."""

    def __init__(
        self,
        robot: Robot,
        site: Site,
        start: StartingPosition,
        seed: int,
        parameters: ProtocolParameters,
        stop: StopRequests,
        kept_photo: Callable[[], bytes | None] = lambda: None,
    ) -> None:
        self.start = start
        self.last: PlacementLook | None = None
        """The last look since the robot was moved."""
        self._robot = robot
        self._site = site
        self._seed = seed
        self._parameters = parameters
        self._stop = stop
        self._kept_photo = kept_photo
        self._matcher: PlacementMatcher | None = None
        self._carried = False
        self._stood: Pose | None = None
        """The robot's own estimate of its pose at the measurement."""

    @property
    def can_measure(self) -> bool:
        """Whether the robot has a depth camera."""
        return Sensor.DEPTH in self._robot.sensors

    def moved(self) -> None:
        """Register that the operator has moved the robot.

        The robot of a rehearsal is moved near its mark by this call, and nearer by each further call.

        Raises:
            Stopped: a request to end the session.
            RobotError: the robot cannot be placed there.
        """
        self.last = None
        self._carried = True
        if self._robot.is_rehearsal:
            with self._stop.interruptible():
                self._robot.simulate_placement(self.start, self._seed)

    def look(self) -> PlacementLook:
        """Look once and measure the robot's pose; takes at most a second more than the camera.

        Raises:
            Stopped: a request to end the session.
        """
        return self._measured(turns=0)

    def turn(self) -> PlacementLook:
        """Turn around in place, look after each turn, and measure the robot's pose from all looks.

        Raises:
            Stopped: a request to end the session.
        """
        return self._measured(turns=max(1, round(360 / self._parameters.turn_deg)))

    def _measured(self, turns: int) -> PlacementLook:
        if not self._carried:
            self.moved()
        self.last = None
        try:
            self.last = self._looked(turns)
        except RobotError as error:
            logger.debug("the placing could not be measured", exc_info=error)
            self.last = self._look_of(None, problem=str(error))
        finally:
            self._robot.halt()
        return self.last

    def _looked(self, turns: int) -> PlacementLook:
        robot = self._robot
        looks: list[DepthLook] = []
        with self._stop.interruptible():
            robot.begin(self.start, self._seed)
            observation = robot.observe()
            _add_depth(observation, looks)
            for _ in range(turns):
                result = robot.drive(self._parameters.movement_of(Action.TURN_LEFT))
                if not result.completed:
                    why = (
                        result.failure or f"it touched {result.collision.touched if result.collision else 'something'}"
                    )
                    return self._look_of(observation, problem=f"it could not turn in place: {why}")
                observation = robot.observe()
                _add_depth(observation, looks)
            self._stood = robot.locate().pose
        if not looks:
            return self._look_of(observation, problem="it has no depth image to measure from: place it by eye")
        if self._matcher is None:
            self._matcher = PlacementMatcher(self._site)
        return self._look_of(observation, self._matcher.measure(self.start, looks, self._parameters.placement))

    def _look_of(
        self, observation: Observation | None, measured: MeasuredPlacement | None = None, problem: str = ""
    ) -> PlacementLook:
        return PlacementLook(self._site, self.start.pose, observation, measured, problem, self._kept_photo())

    def begin(self) -> Fix:
        """Begin the episode at the robot's pose, and return that pose.

        A robot that was moved since its measurement is measured again.

        Raises:
            NotPlacedError: the robot is not placed correctly, which a person can correct.
            RobotError: the robot cannot begin.
            Stopped: a request to end the session.
        """
        if not self._carried:
            self.moved()
        if self.last is not None and self.last.measured is not None and self._was_pushed():
            logger.warning("the robot has moved since its measurement and is measured again")
            self.look()
        with self._stop.interruptible():
            self._robot.begin(self.start, self._seed)
            if (fix := self.fix) is not None:
                self._robot.set_start_pose(fix.pose)
                return fix
            return self._robot.locate()

    @property
    def measured(self) -> MeasuredPlacement | None:
        """The last measurement since the robot was moved."""
        return None if self.last is None else self.last.measured

    @property
    def fix(self) -> Fix | None:
        """Start of the estimated trajectory; None if it was not measured."""
        measured = self.measured
        return Fix(measured.pose, PoseSource.MEASURED) if measured is not None and measured.determined else None

    def _was_pushed(self) -> bool:
        try:
            with self._stop.interruptible():
                now = self._robot.locate().pose
        except RobotError:
            return False
        if self._stood is None:
            return False
        way = now.relative_to(self._stood)
        return self._stood.distance_to(now) > _PUSHED_M or abs(way.heading_rad) > _PUSHED_RAD


def _add_depth(observation: Observation, looks: list[DepthLook]) -> None:
    if observation.depth_m is not None:
        looks.append(DepthLook(observation.depth_m, observation.pose, observation.camera))
