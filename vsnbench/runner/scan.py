"""A scan: a robot is driven through a place, and depth and odometry, which the walls correct, become its map."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from vsnbench.errors import RobotError, SensorLostError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose, wrap_angle
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.contract import CarriedInPlay, MadeReady, Robot
from vsnbench.runner.depth_guard import look_ahead
from vsnbench.runner.stopping import Stopped, Stopping
from vsnbench.scan_matching.tracker import WallTracker
from vsnbench.sensing.occupancy_map import MappingSettings, OccupancyMap
from vsnbench.sensing.plan_grid import FREE, PlanGrid

logger = logging.getLogger(__name__)

RANGE_M: Final = 4.0
"""Farther depth is too rough for a wall's place."""
TOP_M: Final = 1.8
"""Higher points are no wall: lintels, lamps. As high as this, walls are seen above furniture."""
MOST_ACTIONS: Final = 100_000
_KEPT_EVERY: Final = 20
"""Actions after which the map so far is kept."""
_MOST_FAILURES: Final = 3
"""So many movements in a row that fail end a scan."""
_MOST_SILENCES: Final = 3
"""So often is a look tried again where a sensor is silent; each waits as long as a robot's look does."""


@dataclass(frozen=True, slots=True)
class ScanState:
    """What a driver knows when it is asked for the next action."""

    map: OccupancyMap
    pose: Pose
    """Where the robot stands on the map."""
    actions: int
    refused: bool
    """Whether the last action was a forward move that was refused or fell short."""
    collided: bool
    """Whether the robot touched something in the last action."""
    note: str
    """What happened to the last action, where it was not simply done."""
    frame: Pose
    """Where the map's origin lies in the frame in which it is written: the site's, where one is named."""

    @property
    def standing(self) -> Pose:
        """Where the robot stands in the frame in which the map is written."""
        return self.frame.compose(self.pose)

    def grid(self) -> PlanGrid:
        """Return the map as it is written."""
        return _written(self.map, self.frame)

    @property
    def seen_free_m2(self) -> float:
        """Floor that was seen to be free."""
        return seen_free_m2(self.map)


def _written(seen: OccupancyMap, frame: Pose) -> PlanGrid:
    """Return a map, cut to what is known, in the frame in which its own begins at `frame`."""
    drawn = seen.grid_map()
    return PlanGrid(drawn.cells, drawn.resolution_m, frame.compose(Pose(drawn.origin_x_m, drawn.origin_y_m)))


def seen_free_m2(seen: OccupancyMap) -> float:
    """Return how much floor a map knows to be free."""
    return float(np.count_nonzero(seen.cells() == FREE)) * seen.resolution_m**2


class Driver(Protocol):
    """Whoever says where the robot goes."""

    def next(self, state: ScanState) -> Action | None:
        """Return the next action, a movement; None ends the scan."""
        ...


@dataclass(frozen=True, slots=True)
class ScanResult:
    """What a scan left."""

    grid: PlanGrid
    actions: int
    seen_free_m2: float
    stopped: Stopped | None
    """What ended it before its driver did."""
    drift: Pose
    """How far odometry alone was off in the end, in the map's frame, as the walls say."""
    refused: int
    """Looks whose walls asked for a pose that odometry rules out; it was believed."""
    failed: int
    """Movements that were not carried out as asked; the depth guard's refusals are none."""


class Scan:
    """One drive of one robot; what was mapped is kept on every way out."""

    def __init__(
        self,
        robot: Robot,
        start: StartingPosition,
        parameters: ProtocolParameters,
        stop: Stopping,
        *,
        resolution_m: float = 0.05,
        seed: int = 0,
    ) -> None:
        """Prepare a scan whose map lies in the frame in which `start` is given.

        Args:
            robot: with a depth camera.
            start: where it stands, or is put.
            parameters: how far it moves and turns, and the depth guard.
            stop: who may end it.
            resolution_m: side of a cell.
            seed: of a simulated robot's noise.

        Raises:
            RobotError: the robot measures no depth.
        """
        if Sensor.DEPTH not in robot.sensors:
            raise RobotError(f"robot {robot.identity.profile.name} has no depth camera, and a scan needs one")
        profile = robot.identity.profile
        self._robot, self._start, self._parameters, self._stop = robot, start, parameters, stop
        self._settings = MappingSettings(
            resolution_m=resolution_m,
            range_m=min(RANGE_M, profile.camera.depth_max_m),
            obstacle_top_m=TOP_M,
            robot_radius_m=profile.base.radius_m,
        )
        self._map = OccupancyMap(self._settings)
        self._tracker = WallTracker()
        self._drift, self._refused, self._failed = Pose(0.0, 0.0), 0, 0
        self._seed = seed
        self._actions = 0

    def run(
        self,
        driver: Driver,
        kept: Callable[[PlanGrid], object],
        told: Callable[[ScanState], None],
        most_actions: int = MOST_ACTIONS,
    ) -> ScanResult:
        """Drive until the driver or somebody else ends it.

        Args:
            driver: says where to go.
            kept: takes the map so far every now and then, and at the end.
            told: is told of every look.
            most_actions: it ends after so many.

        Raises:
            RobotError: the robot cannot go on; the map so far was kept.
        """
        stopped: Stopped | None = None
        try:
            with self._stop.interruptible():
                self._begin()
            self._drive(driver, kept, told, most_actions)
        except Stopped as acted:
            stopped = acted
        finally:
            self._robot.halt()
            if self._map.known.any():
                kept(self.grid())
        free_m2 = seen_free_m2(self._map)
        return ScanResult(self.grid(), self._actions, free_m2, stopped, self._drift, self._refused, self._failed)

    def grid(self) -> PlanGrid:
        """Return the map so far, cut to what is known."""
        return _written(self._map, self._start.pose)

    def _begin(self) -> None:
        if isinstance(self._robot, MadeReady):
            self._robot.make_ready()
        if isinstance(self._robot, CarriedInPlay) and self._robot.is_carried_in_play:
            self._robot.carry(self._start, self._seed)
        self._robot.begin(self._start, self._seed)

    def _drive(
        self,
        driver: Driver,
        kept: Callable[[PlanGrid], object],
        told: Callable[[ScanState], None],
        most_actions: int,
    ) -> None:
        refused, collided, note, failures = False, False, "", 0
        while True:
            with self._stop.interruptible():
                observation = self._observe()
                pose = self._look(observation)
                state = ScanState(self._map, pose, self._actions, refused, collided, note, self._start.pose)
                told(state)
                action = driver.next(state)
                if action is None or self._actions >= most_actions:
                    return
                refused, collided, note = self._move(action, observation, pose)
            failures = failures + 1 if note and not refused else 0
            if failures >= _MOST_FAILURES:
                raise RobotError(
                    f"the scan ended after {failures} movements that failed: {note}",
                    advice="what was seen until then is in the map",
                )
            self._actions += 1
            if self._actions % _KEPT_EVERY == 0:
                kept(self.grid())

    def _observe(self) -> Observation:
        """Look; a sensor that falls silent for a moment is waited for, since the robot stands."""
        for _ in range(_MOST_SILENCES):
            try:
                return self._robot.observe()
            except SensorLostError as silent:
                logger.warning("waiting: %s", silent)
        return self._robot.observe()

    def _look(self, observation: Observation) -> Pose:
        """Draw what is seen into the map, and return from where."""
        depth_m = observation.depth_m
        if depth_m is None:
            raise SensorLostError("no depth image in this observation")
        odometry = observation.pose
        followed = self._tracker.follow(depth_m, observation.camera, odometry)
        pose, self._refused = followed.pose, self._refused + followed.refused
        turned_rad = wrap_angle(odometry.heading_rad - pose.heading_rad)
        self._drift = Pose(odometry.x_m - pose.x_m, odometry.y_m - pose.y_m, turned_rad)
        self._map.observe(depth_m, observation.camera, pose)
        return pose

    def _move(self, action: Action, observation: Observation, pose: Pose) -> tuple[bool, bool, str]:
        """Carry out an action, unless the depth guard refuses it; where a sensor stays silent, the next look says so.

        Returns:
            Whether it fell short, whether it touched something, and what to say.
        """
        profile = self._robot.identity.profile
        if action is Action.MOVE_FORWARD:
            guard = look_ahead(observation, profile.base, self._parameters.depth_guard)
            if guard.blocked:
                return True, False, f"refused: {guard.words}"
        result = self._robot.execute(action)
        if result.completed:
            return False, result.collision is not None, ""
        self._failed += 1
        words = result.failure or (f"touched {result.collision.touched}" if result.collision else "it fell short")
        if action is Action.MOVE_FORWARD and result.collision:
            ahead = pose.compose(Pose(profile.base.radius_m + self._settings.resolution_m, 0.0))
            self._map.mark_obstacle(ahead.x_m, ahead.y_m, pose)
        return action is Action.MOVE_FORWARD, result.collision is not None, words
