"""Benchmark of visual-semantic-navigation models on real and simulated robots.

The public interface is imported from here: `from vsnbench import Policy, ModelCard, Action, Decision`. The modules that
define it are loaded on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsnbench.errors import ModelError, NotPlacedError, RobotError, VsnbenchError
    from vsnbench.models.contract import BatchPolicy, Policy
    from vsnbench.models.task import Task
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.report.frames import Results, open_results
    from vsnbench.robots.contract import Robot
    from vsnbench.robots.profiles import load_profile
    from vsnbench.settings.yaml_file import read_settings
    from vsnbench.sites.site import Site, StartingPosition
    from vsnbench.values.battery import Battery
    from vsnbench.values.camera import Camera, CameraRole
    from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
    from vsnbench.values.fix import Fix, PoseSource
    from vsnbench.values.goal import Goal, GoalKind
    from vsnbench.values.model.card import Anchor, ModelCard
    from vsnbench.values.model.trained_camera import TrainedCamera
    from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
    from vsnbench.values.movement import (
        Action,
        ActionKind,
        Chunk,
        Drive,
        Move,
        Pixel,
        Sidestep,
        Trajectory,
        Velocity,
        Waypoint,
    )
    from vsnbench.values.observation import Budget, Observation, Sensor
    from vsnbench.values.pose import Pose
    from vsnbench.values.robot_identity import RobotIdentity, kind_of_class

__version__ = "2.0.0"

__all__ = [
    "Action",
    "ActionKind",
    "Anchor",
    "BatchPolicy",
    "Battery",
    "Box",
    "Budget",
    "Camera",
    "CameraRole",
    "Chunk",
    "Collision",
    "CollisionSource",
    "Decision",
    "Diagnostics",
    "Drive",
    "Fix",
    "Goal",
    "GoalKind",
    "GridMap",
    "ModelCard",
    "ModelError",
    "MotionResult",
    "Move",
    "NotPlacedError",
    "Observation",
    "Pixel",
    "Policy",
    "Pose",
    "PoseSource",
    "ProtocolParameters",
    "Results",
    "Robot",
    "RobotError",
    "RobotIdentity",
    "Sensor",
    "Sidestep",
    "Site",
    "StartingPosition",
    "Task",
    "TrainedCamera",
    "Trajectory",
    "Velocity",
    "VsnbenchError",
    "Waypoint",
    "kind_of_class",
    "load_profile",
    "open_results",
    "read_settings",
]

_NAMES = {
    "vsnbench.errors": ("ModelError", "NotPlacedError", "RobotError", "VsnbenchError"),
    "vsnbench.models.contract": ("BatchPolicy", "Policy"),
    "vsnbench.models.task": ("Task",),
    "vsnbench.protocol.parameters": ("ProtocolParameters",),
    "vsnbench.report.frames": ("Results", "open_results"),
    "vsnbench.robots.contract": ("Robot",),
    "vsnbench.robots.profiles": ("load_profile",),
    "vsnbench.settings.yaml_file": ("read_settings",),
    "vsnbench.sites.site": ("Site", "StartingPosition"),
    "vsnbench.values.battery": ("Battery",),
    "vsnbench.values.camera": ("Camera", "CameraRole"),
    "vsnbench.values.decision": ("Box", "Decision", "Diagnostics", "GridMap"),
    "vsnbench.values.fix": ("Fix", "PoseSource"),
    "vsnbench.values.goal": ("Goal", "GoalKind"),
    "vsnbench.values.motion_result": ("Collision", "CollisionSource", "MotionResult"),
    "vsnbench.values.model.card": ("Anchor", "ModelCard"),
    "vsnbench.values.model.trained_camera": ("TrainedCamera",),
    "vsnbench.values.movement": (
        "Action",
        "ActionKind",
        "Chunk",
        "Drive",
        "Move",
        "Pixel",
        "Sidestep",
        "Trajectory",
        "Velocity",
        "Waypoint",
    ),
    "vsnbench.values.observation": ("Budget", "Observation", "Sensor"),
    "vsnbench.values.pose": ("Pose",),
    "vsnbench.values.robot_identity": ("RobotIdentity", "kind_of_class"),
}
"""Public names by the module that defines them."""


def __getattr__(name: str) -> Any:
    for module, names in _NAMES.items():
        if name in names:
            return globals().setdefault(name, getattr(import_module(module), name))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
