"""Encodes the goal and the task of a `reset` or `next_goal` request (docs/wire.md)."""

import hashlib
from dataclasses import asdict
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.task import Task
from vsnbench.values.goal import Goal

PROTOCOL_FIELDS: Final = (
    *("name", "forward_m", "turn_deg", "success_distance_m", "max_actions", "max_time_s", "max_path_m"),
)
"""Parameters of the protocol that a server receives."""


def reset_message(goal: str, seed: int, task: Task | None) -> dict[str, Any]:
    """Return a `reset` request without its number."""
    opaque = hashlib.sha256(f"{goal}/{seed}".encode()).hexdigest()[:16]
    message: dict[str, Any] = {"type": "reset", "episode": opaque, "seed": seed, **_goal(goal)}
    if task is not None:
        robot = {**asdict(task.robot), "camera": task.robot.camera.model_dump(mode="json")}
        protocol = {name: getattr(task.protocol, name) for name in PROTOCOL_FIELDS}
        message["task"] = {"protocol": protocol, "robot": robot}
    return message


def next_goal_message(goal: str) -> dict[str, Any]:
    """Return a `next_goal` request without its number."""
    return {"type": "next_goal", **_goal(goal)}


def _goal(goal: str) -> dict[str, Any]:
    whole = goal if isinstance(goal, Goal) else Goal(goal)
    fields: dict[str, Any] = {name: str(getattr(whole, name)) for name in ("id", "kind", "text", "category")}
    if whole.image is not None:
        fields["image"] = _photograph(whole.image)
    if whole.images:
        fields["images"] = [_photograph(image) for image in whole.images]
    if whole.point is not None:
        fields["point"] = list(whole.point)
    return {"goal": str(goal), "goal_fields": fields}


def _photograph(image: npt.NDArray[np.uint8]) -> dict[str, Any]:
    height, width = image.shape[:2]
    return {"encoding": "raw", "height": height, "width": width, "data": image.tobytes()}
