"""What a policy receives when an episode begins: goal, protocol, robot and seed."""

from dataclasses import dataclass

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.camera import Camera
from vsnbench.values.robot_profile import RobotProfile


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """The part of the robot's profile that a policy receives."""

    name: str
    radius_m: float
    height_m: float
    max_linear_m_s: float
    max_angular_rad_s: float
    camera: Camera
    """The robot's camera. The camera of an observation counts where they differ."""
    max_lateral_m_s: float = 0.0
    """0 for a base that cannot move sideways."""


@dataclass(frozen=True, slots=True)
class Task:
    """Goal and circumstances of one episode."""

    goal: str
    """The goal: a `vsnbench.Goal` in a run, which is also a string, such as `chair`."""
    seed: int
    """Source of every random choice in the episode."""
    protocol: ProtocolParameters
    """Parameters of the protocol. A model in another process receives its name, sizes and limits (docs/wire.md); the
    other fields have their defaults."""
    robot: RobotFacts


def task_of(goal: str, seed: int, parameters: ProtocolParameters, profile: RobotProfile) -> Task:
    """Return the task of an episode."""
    base = profile.base
    return Task(
        goal,
        seed,
        parameters,
        RobotFacts(
            name=profile.name,
            radius_m=base.radius_m,
            height_m=base.height_m,
            max_linear_m_s=base.max_linear_m_s,
            max_angular_rad_s=base.max_angular_rad_s,
            camera=profile.camera.model_copy(),
            max_lateral_m_s=base.max_lateral_m_s,
        ),
    )
