"""Synthetic tasks and observations, with which a policy is tried without a robot."""

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.models.contract import Policy
from vsnbench.models.task import RobotFacts, Task, task_of
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.observation import ArraySpec, Budget, InstanceImage, Observation, Sensor, newest_of, with_changes
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

_ANY_LENGTH = 90
"""Length of a synthetic array's dimension whose length is not fixed."""


def synthetic_observation(
    policy: Policy, number: int, width: int = 640, height: int = 480, *, blind: bool = False
) -> Observation:
    """Return a synthetic observation as the policy receives it: noise, the same for the same number.

    After the first one it has a history of two observations for a policy whose card asks for that.
    """
    left = Budget(ProtocolParameters().max_actions - number)
    newest = every_sensor(number, width, height, blind=blind, roles=policy.card.cameras)
    earlier = [replace(newest, stamp_s=number - ago) for ago in (0.5, 0.25)] if number else []
    given = replace(newest, history=newest_of(earlier, newest, policy.card.history))
    return policy.card.shown(given, left)


def synthetic_task(goal: str, seed: int, profile: RobotProfile | None = None) -> Task:
    """Return a task under the paper's protocol, on a robot with the synthetic camera.

    Args:
        goal: the goal.
        seed: the seed.
        profile: robot of the task; None for a robot of common size.
    """
    paper = ProtocolParameters()
    robot = RobotFacts("synthetic", 0.18, 0.6, 0.5, 1.5, synthetic_camera(640, 480))
    if profile is not None:
        robot = replace(task_of(goal, seed, paper, profile).robot, camera=robot.camera)
    return Task(goal, seed, paper, robot)


def synthetic_camera(width: int, height: int) -> Camera:
    """Return the camera of the synthetic robot with another image size."""
    return Camera(width=width, height=height, horizontal_fov_deg=60, mount_height_m=0.6)


def every_sensor(
    number: int,
    width: int = 640,
    height: int = 480,
    *,
    blind: bool = False,
    roles: AbstractSet[CameraRole] = frozenset(),
) -> Observation:
    """Return noise for every sensor, the same for the same number; `blind` has black colours and no valid distances.

    Each of `roles` is a further camera with noise of its own.
    """
    rng, pose = np.random.default_rng(number), Pose(0.25 * number, 0.0, 0.1 * number)
    measured: dict[str, Any] = {"pose": pose}
    for sensor in Sensor:
        if sensor is Sensor.INSTANCES:
            ids = rng.integers(0, 3, (height, width)).astype(np.int32)
            measured[sensor.field] = InstanceImage(ids, {1: "chair", 2: "bed"})
        elif sensor.array is not None:
            measured[sensor.field] = _noise(sensor.array, {"height": height, "width": width}, rng, blind=blind)
    further: dict[CameraRole, Observation] = {
        role: with_changes(every_sensor(number + shift, width, height, blind=blind), pose=pose, stamp_s=float(number))
        for shift, role in enumerate(CameraRole)
        if role in roles and role is not CameraRole.FRONT
    }
    return Observation(stamp_s=float(number), camera=synthetic_camera(width, height), cameras=further, **measured)


def _noise(
    spec: ArraySpec, lengths: Mapping[str, int], rng: np.random.Generator, *, blind: bool
) -> npt.NDArray[np.generic]:
    """Return noise in the form of a sensor; where NaN has a meaning, an eighth of each row is NaN.

    Args:
        spec: the form.
        lengths: length of a dimension by name; others have `_ANY_LENGTH`.
        rng: source of the noise.
        blind: whether every value is NaN, or else 0.
    """
    low, high = spec.span
    shape = tuple(length if isinstance(length, int) else lengths.get(length, _ANY_LENGTH) for length in spec.shape)
    if np.issubdtype(spec.dtype, np.integer):
        values = rng.integers(int(low), int(high) + 1, shape, spec.dtype)
    else:
        values = rng.uniform(low, high, shape).astype(spec.dtype)
    if spec.nan:
        values[..., : shape[-1] if blind else shape[-1] // 8] = np.nan
    elif blind:
        values[...] = 0
    return values
