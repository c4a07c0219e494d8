"""A robot and a policy whose behaviour and faults a test scripts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.movements import ACTION_OF
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot, Watch
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.sites.site import StartingPosition, load_site
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity, kind_of_class
from vsnbench.values.robot_profile import RobotProfile

APARTMENT = load_site("apartment")
PROFILE = RobotProfile.model_validate(
    {
        "name": "stand-in",
        "title": "Stand-in",
        "base": {
            "radius_m": 0.18,
            "height_m": 0.6,
            "mass_kg": 6,
            "track_m": 0.23,
            "wheel_radius_m": 0.035,
            "max_linear_m_s": 0.7,
            "max_angular_rad_s": 3,
            "odometry_rate_hz": 50,
        },
        "camera": {"width": 64, "height": 48, "horizontal_fov_deg": 60, "mount_height_m": 0.6},
    }
)
PLAN = EpisodePlan(APARTMENT, "chair", APARTMENT.starts[0], 7, ProtocolParameters(max_actions=6))


@dataclass
class StandInRobot(Robot):
    """Moves by adding to its pose; its faults are scripted by the test."""

    on_observe: Callable[[int], None] = lambda _count: None
    on_execute: Callable[[Action], MotionResult] = lambda _action: MotionResult(completed=True)
    depth_m: float = 3.0
    place: Pose = field(default_factory=lambda: Pose(0, 0))
    profile: RobotProfile = PROFILE
    sensors: frozenset[Sensor] = frozenset(Sensor)
    simulated: bool = True
    conditions: Mapping[str, Any] = field(default_factory=dict)
    looks: int = 0
    executed: list[Action] = field(default_factory=list)
    halts: int = 0
    begun_with: tuple[int, int] | None = None

    @property
    def identity(self) -> RobotIdentity:
        return RobotIdentity(self.profile, kind_of_class(type(self)), self.simulated)

    def begin(self, start: StartingPosition, seed: int) -> None:
        self.place = start.pose
        self.begun_with = (start.number, seed)

    def observe(self) -> Observation:
        self.looks += 1
        self.on_observe(self.looks)
        depth = np.full((48, 64), self.depth_m, np.float32)
        return Observation(np.zeros((48, 64, 3), np.uint8), depth, Pose(0, 0), 0.0, PROFILE.camera)

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        self.executed.append(ACTION_OF[movement])
        return self.on_execute(self.executed[-1])

    def locate(self) -> Fix:
        return Fix(self.place, PoseSource.SIMULATED)

    def halt(self) -> None:
        self.halts += 1


@dataclass
class ScriptedPolicy(Policy):
    """Returns scripted actions and repeats the last one; raises exceptions in the script."""

    script: list[Action | Exception]
    card: ModelCard = field(default_factory=lambda: ModelCard("scripted"))
    asked: int = 0

    def reset(self, goal: str, seed: int) -> None:
        self.asked = 0

    def act(self, observation: Observation) -> Decision:
        answer = self.script[min(self.asked, len(self.script) - 1)]
        self.asked += 1
        if isinstance(answer, Exception):
            raise answer
        return Decision(answer)


NOBODY = AbsentOperator()
