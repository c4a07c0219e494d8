"""A simulated robot that plays a real one: a person has to place it, and it knows only what its sensors say.

For a rehearsal at a desk: it stands near its marks and not at them, so that the check of the placing has something to
find; where it stands is estimated from its odometry; its verdicts await a person's judgement. It is recorded as
simulated, and its campaigns are their own.
"""

from collections.abc import Mapping
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import SIMULATED, RobotIdentity
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.simulator.noise import NoiseSettings
from vsnbench.simulator.pretended_person import PretendedPerson

PRETENDED = "pretends_to_be_real"
"""The condition by which a record knows a rehearsal."""


class PretendedRobot(SimulatedRobot):
    """A simulated robot that has to be placed as a real one has."""

    needs_a_person = True
    is_carried_in_play = True

    def __init__(
        self,
        site: Site,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        noise: NoiseSettings | None = None,
        read: frozenset[Sensor] = SimulatedRobot.sensors,
    ) -> None:
        super().__init__(site, profile, parameters, noise, read)
        self.conditions: Mapping[str, Any] = {**self.conditions, PRETENDED: True}
        self._person = PretendedPerson()
        self._is_down = False
        self._start = Pose(0.0, 0.0)

    @property
    def identity(self) -> RobotIdentity:
        """Who it is: a simulated robot."""
        return RobotIdentity(self.profile, SIMULATED, simulated=True, site_sha256=self.site.sha256)

    @property
    def true_pose(self) -> Pose:
        """Where it really stands; what nobody asks in a rehearsal."""
        return self._physics.pose

    def carry(self, start: StartingPosition, seed: int) -> None:
        """Put it down near the mark; nearer, where it stands there already."""
        there = self._person.put_down(start.pose, self._physics.pose, seed, self._touches)
        self._physics.place(there)
        self._is_down = True

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Begin where it stands, with odometry, time and heading target at zero.

        Raises:
            RobotError: nobody has carried it anywhere.
        """
        if not self._is_down:
            raise RobotError("nobody has put the robot down anywhere yet", advice="carry it to its mark first")
        super().begin(_with_mark_at(start, self._physics.pose), seed)
        self._start = start.pose

    def stands_at(self, pose: Pose) -> None:
        """Take that the episode began there."""
        self._start = pose

    def locate(self) -> Fix:
        """Return what the odometry makes of where it began."""
        self._require_begun()
        return Fix(self._start.compose(self._odometry), PoseSource.ESTIMATED)

    def _touches(self, pose: Pose) -> str:
        self._physics.place(pose)
        touch = self._physics.touch()
        return self._name_of(touch) if touch else ""


def _with_mark_at(start: StartingPosition, pose: Pose) -> StartingPosition:
    """Return the start with its mark under the robot."""
    return start.model_copy(update={"position": pose.position, "heading_deg": pose.heading_deg})
