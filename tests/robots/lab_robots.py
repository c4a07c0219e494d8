"""Six robots of labs, with stand-ins of their bases, and movements that each of them executes."""

import math
from pathlib import Path
from typing import NamedTuple

from vsnbench.robots.profiles import load_dynamics, load_profile
from vsnbench.values.movement import Drive, Move, Sidestep, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import BaseDynamics, RobotProfile

EXAMPLES = Path(__file__).parents[2] / "examples"


class LabRobot(NamedTuple):
    """A profile, and the file of its base if the profile has no `dynamics`."""

    robot: str
    base: Path | None = None

    @property
    def profile(self) -> RobotProfile:
        return load_profile(self.robot)

    @property
    def dynamics(self) -> BaseDynamics:
        return load_dynamics(self.base, self.profile)


ROBOTS = {
    "go2": LabRobot(str(EXAMPLES / "robots" / "go2.yaml")),
    "spot": LabRobot(str(EXAMPLES / "robots" / "spot.yaml")),
    "stretch": LabRobot("stretch", EXAMPLES / "bases" / "stretch.yaml"),
    "jackal": LabRobot(str(EXAMPLES / "robots" / "jackal.yaml")),
    "turtlebot4": LabRobot("turtlebot4", EXAMPLES / "bases" / "create3.yaml"),
    "limo": LabRobot(str(EXAMPLES / "robots" / "limo.yaml")),
}
_FORWARD, _LEFT, _RIGHT = (Move(0.25, 0.0, True), *(Move(0.0, sign * math.radians(30), True) for sign in (1, -1)))
_ANY_BASE: list[Drive] = [
    *(_FORWARD, _LEFT, _FORWARD, _RIGHT, _FORWARD),
    *(Waypoint(0.6, -0.3), Waypoint(-0.5, 0.4, 0.0), Waypoint(0.4, 0.0, math.radians(-90))),
    *(Trajectory(((0.3, 0.0), (0.6, 0.1), (0.8, 0.3))), Trajectory(((0.2, 0.0), (0.4, -0.1), (0.5, -0.3)))),
    *(Velocity(0.2, 0.0, 1.0), Velocity(0.2, 0.4, 1.5), Velocity(0.0, -0.4, 1.0)),
    *(Move(0.4, math.radians(45)), Move(-0.25), Move(0.3, math.radians(-100))),
]
_SIDEWAYS: list[Drive] = [Sidestep(0.25), Sidestep(-0.3), _LEFT, _FORWARD]
_ON_THE_SPOT: list[Drive] = [_RIGHT, _FORWARD, _LEFT, _FORWARD]


def movements(profile: RobotProfile) -> list[Drive]:
    """Return twenty movements of all kinds of a base."""
    return [*_ANY_BASE, *(_SIDEWAYS if profile.base.max_lateral_m_s else _ON_THE_SPOT)]


def disagreement(true: tuple[Pose, Pose], odometry: tuple[Pose, Pose]) -> tuple[float, float]:
    """Return by how much the odometry of one movement is wrong: metres and radians.

    Args:
        true: true poses before and after.
        odometry: poses of the odometry before and after.
    """
    moved, counted = (after.relative_to(before) for before, after in (true, odometry))
    return moved.distance_to(counted), abs(math.remainder(moved.heading_rad - counted.heading_rad, math.tau))
