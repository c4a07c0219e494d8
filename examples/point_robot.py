"""A robot for vsnbench: a point that executes every action exactly, sees a grainy wall and touches nothing.

It implements every abstract method of `vsnbench.Robot`. Run it from this directory:

    vsnbench run --robot point_robot:PointRobot --model random --goal chair --starts 1
"""

from types import MappingProxyType

import numpy as np

from vsnbench import (
    Drive,
    Fix,
    MotionResult,
    Move,
    Observation,
    Pose,
    PoseSource,
    ProtocolParameters,
    Robot,
    RobotError,
    RobotIdentity,
    Sensor,
    Site,
    StartingPosition,
    kind_of_class,
    load_profile,
)

ACTION_DURATION_S = 1.5


class PointRobot(Robot):
    """The constructor may take `site`, `parameters`, both or neither."""

    sensors = frozenset({Sensor.RGB, Sensor.ODOMETRY})
    conditions = MappingProxyType({"action_duration_s": ACTION_DURATION_S})  # trials under others: another campaign

    def __init__(self, site: Site, parameters: ProtocolParameters) -> None:
        self._profile = load_profile("turtlebot2")
        self._site = site
        self._parameters = parameters
        self._start: StartingPosition | None = None
        self._odometry = Pose(0.0, 0.0)
        self._clock_s = 0.0

    @property
    def identity(self) -> RobotIdentity:
        """A simulated robot sets `site_sha256`; a real robot does not."""
        kind = kind_of_class(type(self))
        return RobotIdentity(self._profile, kind, simulated=True, site_sha256=self._site.sha256)

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode. Every random number follows from the seed, so that a trial can be repeated bit by bit."""
        self._start, self._odometry, self._clock_s = start, Pose(0.0, 0.0), 0.0
        self._rng = np.random.default_rng(seed)

    def observe(self) -> Observation:
        """Return new arrays: the depth guard, the recorder and the policy use them later."""
        camera = self._profile.camera
        rgb = self._rng.integers(120, 136, (camera.height, camera.width, 3), np.uint8)
        return Observation(rgb, None, self._odometry, self._clock_s, camera)

    def drive(self, movement: Drive, watch: object = None) -> MotionResult:
        """Return the measured displacement and turn; of this robot, they are the requested ones.

        Without other `action_kinds`, every movement is an action of the paper: a turn, a straight move, or no motion.
        """
        if not isinstance(movement, Move):
            raise RobotError("this robot has no paths and velocities")
        self._odometry = self._odometry.compose(Pose(movement.distance_m, 0.0, movement.turn_rad))
        self._clock_s += ACTION_DURATION_S
        return MotionResult(True, movement.distance_m, movement.turn_rad, ACTION_DURATION_S, pose=self._odometry)

    def locate(self) -> Fix:
        """Return the pose for judging."""
        if self._start is None:
            raise RobotError("the robot has no pose yet: begin an episode first")
        return Fix(self._start.pose.compose(self._odometry), PoseSource.SIMULATED)

    def halt(self) -> None:
        """A real robot commands zero velocity here. Called on every exit path, from any thread, repeatedly."""
