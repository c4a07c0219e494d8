"""Putting a robot at its mark, measured: looks, turns on the spot, and what is known when a person says go.

Whoever stands beside the robot is handed one of these with each request to place it, and calls it on the thread that
asked: a robot has one user.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vsnbench.errors import NotPlacedError, RobotError
from vsnbench.placement.ghost import ghost, ghost_png, laid_over
from vsnbench.placement.looks import DepthLook
from vsnbench.placement.matching import PlacementMatcher
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pictures import encode_jpeg, encode_png
from vsnbench.protocol.placement import MeasuredPlacement, PlacementTolerance
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.robots.contract import CarriedInPlay, Robot
from vsnbench.runner.stopping import Stopping
from vsnbench.whole_files import write_whole

logger = logging.getLogger(__name__)

_PUSHED_M, _PUSHED_RAD = 0.01, 0.01
"""A robot whose odometry has gone on by more since it was measured is measured again."""


@dataclass(frozen=True, eq=False)
class PlacementLook:
    """What the robot sees at its mark, and what that says of where it stands."""

    site: Site
    mark: Pose
    observation: Observation | None
    """The last look; None where the robot could not look."""
    measured: MeasuredPlacement | None = None
    """None where there was nothing to measure with."""
    problem: str = ""
    """Why there is no look, or no measurement."""
    photo_jpeg: bytes | None = None
    """What was seen here when this robot was first accepted at this mark; None where nothing is kept."""

    @property
    def rgb(self) -> npt.NDArray[np.uint8] | None:
        """(H, W, 3), what the robot sees now."""
        return None if self.observation is None else self.observation.rgb

    @cached_property
    def picture_jpeg(self) -> bytes | None:
        """What the robot sees now, as JPEG."""
        return None if self.rgb is None else encode_jpeg(self.rgb)

    @cached_property
    def ghost_png(self) -> bytes | None:
        """The edges of what it should see from its mark, as a PNG of the picture's size, clear elsewhere."""
        return None if self.observation is None else ghost_png(self.site, self.observation.camera, self.mark)

    def write_overlay(self, path: Path) -> None:
        """Write what the robot sees with the edges of what it should see over it, as PNG.

        Raises:
            RobotError: it could not look.
            RecordError: the file cannot be written.
        """
        if self.observation is None:
            raise RobotError(f"there is no picture: {self.problem}")
        seen = self.observation
        over = laid_over(seen.rgb, ghost(self.site, seen.camera, self.mark))
        solid = np.full((*over.shape[:2], 1), 255, np.uint8)
        write_whole(path, encode_png(np.concatenate([over, solid], axis=2)))


class Placing:
    """One placing of a robot at the start of an episode."""

    def __init__(
        self,
        robot: Robot,
        site: Site,
        start: StartingPosition,
        seed: int,
        parameters: ProtocolParameters,
        stop: Stopping,
        kept_photo: Callable[[], bytes | None] = lambda: None,
    ) -> None:
        self.start = start
        self.last: PlacementLook | None = None
        """What was seen last since the robot was moved."""
        self._robot = robot
        self._site = site
        self._seed = seed
        self._parameters = parameters
        self._stop = stop
        self._kept_photo = kept_photo
        self._matcher: PlacementMatcher | None = None
        self._carried = False
        self._stood: Pose | None = None
        """Where the robot estimated itself to be when it was measured."""

    @property
    def tolerance(self) -> PlacementTolerance:
        """How far off the mark it may stand."""
        return self._parameters.placement

    @property
    def can_measure(self) -> bool:
        """Whether it has a depth camera to measure with."""
        return Sensor.DEPTH in self._robot.sensors

    @property
    def pretended(self) -> bool:
        """Whether nobody has to carry it: `moved` plays the person."""
        return isinstance(self._robot, CarriedInPlay) and self._robot.is_carried_in_play

    def moved(self) -> None:
        """Hear that a person has put the robot at the mark, or has mended how it stands there.

        A robot that is only played is put down near its mark by this; again, nearer.

        Raises:
            Stopped: somebody asked the session to stop.
            RobotError: it cannot be put there.
        """
        self.last = None
        self._carried = True
        if isinstance(self._robot, CarriedInPlay) and self._robot.is_carried_in_play:
            with self._stop.interruptible():
                self._robot.carry(self.start, self._seed)

    def look(self) -> PlacementLook:
        """Look once, and measure from it where the robot stands; at most a second beside the camera's own time.

        Raises:
            Stopped: somebody asked the session to stop.
        """
        return self._measured(())

    def turn(self, progress: Callable[[int, int], None] | None = None) -> PlacementLook:
        """Turn once around on the spot, looking after each turn, and measure from all of it.

        Args:
            progress: told after each look how many there are, and how many there will be.

        Raises:
            Stopped: somebody asked the session to stop.
        """
        count = max(1, round(360 / self._parameters.turn_deg))
        steps = (Action.TURN_LEFT,) * count
        return self._measured(steps, progress)

    def _measured(self, steps: tuple[Action, ...], progress: Callable[[int, int], None] | None = None) -> PlacementLook:
        if not self._carried:
            self.moved()
        self.last = None
        try:
            self.last = self._looked(steps, progress)
        except NotPlacedError as error:
            self.last = self._seen(None, problem=str(error))
        except RobotError as error:
            logger.debug("the placing could not be measured", exc_info=error)
            self.last = self._seen(None, problem=str(error))
        finally:
            self._robot.halt()
        return self.last

    def _looked(self, steps: tuple[Action, ...], progress: Callable[[int, int], None] | None) -> PlacementLook:
        robot = self._robot
        looks: list[DepthLook] = []
        with self._stop.interruptible():
            robot.begin(self.start, self._seed)
            seen = robot.observe()
            _keep(seen, looks)
            for number, step in enumerate(steps, start=1):
                if progress is not None:
                    progress(number, len(steps) + 1)
                result = robot.execute(step)
                if not result.completed:
                    why = (
                        result.failure or f"it touched {result.collision.touched if result.collision else 'something'}"
                    )
                    return self._seen(seen, problem=f"it could not turn on the spot: {why}")
                seen = robot.observe()
                _keep(seen, looks)
            self._stood = robot.locate().pose
        if progress is not None:
            progress(len(steps) + 1, len(steps) + 1)
        if not looks:
            return self._seen(seen, problem="it has no depth image to measure from: place it by eye")
        if self._matcher is None:
            self._matcher = PlacementMatcher(self._site, seen.camera)
        return self._seen(seen, self._matcher.measure(self.start, looks, self.tolerance))

    def _seen(
        self, observation: Observation | None, measured: MeasuredPlacement | None = None, problem: str = ""
    ) -> PlacementLook:
        return PlacementLook(self._site, self.start.pose, observation, measured, problem, self._kept_photo())

    def begin(self) -> Fix:
        """Begin the episode where the robot stands, and return what is known of that.

        A robot that was pushed since it was measured is measured again.

        Raises:
            NotPlacedError: it does not stand as it should; a person can put that right.
            RobotError: it cannot begin.
            Stopped: somebody asked the session to stop.
        """
        if not self._carried:
            self.moved()
        if self.last is not None and self.last.measured is not None and self._was_pushed():
            logger.warning("the robot was moved since it was measured: it is measured again")
            self.look()
        with self._stop.interruptible():
            self._robot.begin(self.start, self._seed)
            if (fix := self.fix) is not None:
                stands_at = getattr(self._robot, "stands_at", None)
                if stands_at is not None:
                    stands_at(fix.pose)
                return fix
            return self._robot.locate()

    @property
    def measured(self) -> MeasuredPlacement | None:
        """What was measured since the robot was moved last."""
        return None if self.last is None else self.last.measured

    @property
    def fix(self) -> Fix | None:
        """Where the estimated trajectory begins; None where no measurement says."""
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


def _keep(seen: Observation, looks: list[DepthLook]) -> None:
    if seen.depth_m is not None:
        looks.append(DepthLook(seen.depth_m, seen.pose))
