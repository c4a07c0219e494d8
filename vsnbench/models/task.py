"""What a policy receives when an episode begins: goal, protocol, robot and seed."""

from dataclasses import dataclass

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.camera import Camera
from vsnbench.values.robot_profile import RobotProfile


@dataclass(frozen=True, slots=True)
class ProtocolFacts:
    """The part of the protocol that a policy receives."""

    name: str
    forward_m: float
    """Length of MOVE_FORWARD and MOVE_BACKWARD."""
    turn_deg: float
    """Angle of TURN_LEFT and TURN_RIGHT."""
    success_distance_m: float
    """STOP nearer than this to the goal succeeds."""
    max_actions: int
    max_time_s: float | None = None
    """Seconds on the robot's clock; None for no limit."""
    max_path_m: float | None = None
    """None for no limit."""


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


@dataclass(frozen=True, slots=True)
class Task:
    """Goal and circumstances of one episode."""

    goal: str
    """The goal: a `vsnbench.Goal` in a run, which is also a string, such as `chair`."""
    seed: int
    """Source of every random choice in the episode."""
    protocol: ProtocolFacts
    robot: RobotFacts


def task_of(goal: str, seed: int, parameters: ProtocolParameters, profile: RobotProfile) -> Task:
    """Return the task of an episode."""
    base = profile.base
    return Task(
        goal,
        seed,
        ProtocolFacts(
            name=parameters.name,
            forward_m=parameters.forward_m,
            turn_deg=parameters.turn_deg,
            success_distance_m=parameters.success_distance_m,
            max_actions=parameters.max_actions,
            max_time_s=parameters.max_time_s,
            max_path_m=parameters.max_path_m,
        ),
        RobotFacts(
            name=profile.name,
            radius_m=base.radius_m,
            height_m=base.height_m,
            max_linear_m_s=base.max_linear_m_s,
            max_angular_rad_s=base.max_angular_rad_s,
            camera=profile.camera.model_copy(),
        ),
    )
