"""A simulated robot that is treated as a real one, to rehearse a session with an operator.

It is placed near its marks, not at them, so that the placement check finds an offset. Its pose is estimated from
odometry, and its verdicts await a judgement. The record has it as simulated, in separate campaigns.
"""

from collections.abc import Mapping
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.simulated_operator import SimulatedOperator
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.observation import Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import REHEARSAL_KEY, SIMULATED, RobotIdentity
from vsnbench.values.robot_profile import RobotProfile


class RehearsalRobot(SimulatedRobot):
    """A simulated robot that needs an operator, like a real one."""

    needs_operator = True
    is_rehearsal = True

    def __init__(
        self,
        site: Site,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        noise: NoiseSettings | None = None,
        read: frozenset[Sensor] = SimulatedRobot.sensors,
    ) -> None:
        super().__init__(site, profile, parameters, noise, read)
        self.conditions: Mapping[str, Any] = {**self.conditions, REHEARSAL_KEY: True}
        self._person = SimulatedOperator()
        self._is_placed = False
        self._start = Pose(0.0, 0.0)

    @property
    def identity(self) -> RobotIdentity:
        """Profile and kind of the robot: a simulated robot."""
        return RobotIdentity(self.profile, SIMULATED, simulated=True, site_sha256=self.site.sha256)

    def simulate_placement(self, start: StartingPosition, seed: int) -> None:
        """Move the robot near its mark; nearer if it is there already."""
        pose = self._person.put_down(start.pose, self._physics.pose, seed, self._touches)
        self._physics.place(pose)
        self._is_placed = True

    def keep_real_time(self) -> None:
        """Let movements take as long as on the real robot, so that an operator can practise to stop it."""
        self._base.is_real_time = True

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode at the robot's pose, with odometry, time and target heading at zero.

        Raises:
            RobotError: the robot has not been placed.
        """
        if not self._is_placed:
            raise RobotError("the robot has not been placed yet", advice="place it at its mark first")
        here = self._physics.pose
        super().begin(start.model_copy(update={"position": here.position, "heading_deg": here.heading_deg}), seed)
        self._start = start.pose

    def set_start_pose(self, pose: Pose) -> None:
        """Take a pose as the start of the episode."""
        self._start = pose

    def locate(self) -> Fix:
        """Return the pose estimated from the start and the odometry."""
        self._require_begun()
        return Fix(self._start.compose(self._odometry), PoseSource.ESTIMATED)

    def _touches(self, pose: Pose) -> str:
        self._physics.place(pose)
        touch = self._physics.touch()
        return self._name_of(touch) if touch else ""
