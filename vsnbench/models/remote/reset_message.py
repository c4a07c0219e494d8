"""Encodes the goal and the task of a `reset` request (docs/wire.md)."""

import hashlib
from dataclasses import asdict
from typing import Any, Final

from vsnbench.models.task import Task
from vsnbench.values.goal import Goal

PROTOCOL_FIELDS: Final = (
    *("name", "forward_m", "turn_deg", "success_distance_m", "max_actions", "max_time_s", "max_path_m"),
)
"""Parameters of the protocol that a server receives."""


def reset_message(goal: str, seed: int, task: Task | None) -> dict[str, Any]:
    """Return a `reset` request without its number."""
    opaque = hashlib.sha256(f"{goal}/{seed}".encode()).hexdigest()[:16]
    message: dict[str, Any] = {"type": "reset", "episode": opaque, "goal": str(goal), "seed": seed}
    message["goal_fields"] = _goal_fields(goal if isinstance(goal, Goal) else Goal(goal))
    if task is not None:
        robot = {**asdict(task.robot), "camera": task.robot.camera.model_dump(mode="json")}
        protocol = {name: getattr(task.protocol, name) for name in PROTOCOL_FIELDS}
        message["task"] = {"protocol": protocol, "robot": robot}
    return message


def _goal_fields(goal: Goal) -> dict[str, Any]:
    fields: dict[str, Any] = {"id": goal.id, "kind": goal.kind.value, "text": goal.text, "category": goal.category}
    if goal.image is not None:
        height, width = goal.image.shape[:2]
        fields["image"] = {"encoding": "raw", "height": height, "width": width, "data": goal.image.tobytes()}
    return fields
