"""A robot of one's own: a point that carries out every action exactly, sees a grainy wall, and touches nothing.

It shows all that `vsnbench.robots.contract.Robot` asks for. Run it from this directory:

    vsnbench run --robot point_robot:PointRobot --model random --goal chair --starts 1
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vsnbench.errors import RobotError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import RobotIdentity, kind_of_class
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile

SECONDS_AN_ACTION = 1.5


class PointRobot(Robot):
    """Made with what it names of `site` and `parameters`; a robot of yours may name neither."""

    sensors = frozenset({Sensor.RGB, Sensor.ODOMETRY})

    def __init__(self, site: Site, parameters: ProtocolParameters) -> None:
        self._profile = load_profile("turtlebot2")
        self._site = site
        self._parameters = parameters
        self._start: StartingPosition | None = None
        self._odometry = Pose(0.0, 0.0)
        self._clock_s = 0.0

    @property
    def identity(self) -> RobotIdentity:
        """A simulated robot says which site it plays; a real one leaves `site_sha256` out."""
        kind = kind_of_class(type(self))
        return RobotIdentity(self._profile, kind, simulated=True, site_sha256=self._site.sha256)

    @property
    def conditions(self) -> Mapping[str, Any]:
        """Change one of these and it is another campaign."""
        return {"seconds_an_action": SECONDS_AN_ACTION}

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Everything random follows from the seed: the same trial is the same, bit by bit."""
        self._start, self._odometry, self._clock_s = start, Pose(0.0, 0.0), 0.0
        self._rng = np.random.default_rng(seed)

    def observe(self) -> Observation:
        """Arrays are fresh ones: the guard, the recorder and the policy rely on nobody writing into them later."""
        camera = self._profile.camera
        rgb = self._rng.integers(120, 136, (camera.height, camera.width, 3), np.uint8)
        return Observation(rgb, None, self._odometry, self._clock_s, camera)

    def execute(self, action: Action) -> MotionResult:
        """Displacement and turn are what was measured, not what was asked; here they are the same."""
        before, forward_m, turn_deg = self._odometry, self._parameters.forward_m, self._parameters.turn_deg
        way_m = {Action.MOVE_FORWARD: forward_m, Action.MOVE_BACKWARD: -forward_m}.get(action, 0.0)
        turn_rad = math.radians({Action.TURN_LEFT: turn_deg, Action.TURN_RIGHT: -turn_deg}.get(action, 0.0))
        self._odometry = before.compose(Pose(way_m, 0.0, turn_rad))
        self._clock_s += SECONDS_AN_ACTION
        return MotionResult(True, way_m, turn_rad, SECONDS_AN_ACTION, pose=self._odometry)

    def locate(self) -> Fix:
        """For the judge alone."""
        if self._start is None:
            raise RobotError("the point stands nowhere yet: begin an episode first")
        return Fix(self._start.pose.compose(self._odometry), PoseSource.SIMULATED)

    def halt(self) -> None:
        """A real robot commands zero velocity here: on every way out, from any thread, more than once."""

    def close(self) -> None:
        """Let go of everything; a real robot halts first."""
        self.halt()
