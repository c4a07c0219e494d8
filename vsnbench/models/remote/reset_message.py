"""Encodes the goal and the task of a `reset` request (docs/wire.md)."""

import hashlib
from dataclasses import asdict
from typing import Any

from vsnbench.models.task import Task
from vsnbench.values.goal import Goal


def reset_message(goal: str, seed: int, task: Task | None) -> dict[str, Any]:
    """Return a `reset` request without its number."""
    opaque = hashlib.sha256(f"{goal}/{seed}".encode()).hexdigest()[:16]
    message: dict[str, Any] = {"type": "reset", "episode": opaque, "goal": str(goal), "seed": seed}
    message["goal_fields"] = _goal_fields(goal if isinstance(goal, Goal) else Goal(goal))
    if task is not None:
        robot = {**asdict(task.robot), "camera": task.robot.camera.model_dump(mode="json")}
        message["task"] = {"protocol": asdict(task.protocol), "robot": robot}
    return message


def _goal_fields(goal: Goal) -> dict[str, Any]:
    fields: dict[str, Any] = {"id": goal.id, "kind": goal.kind.value, "text": goal.text, "category": goal.category}
    if goal.image is not None:
        height, width = goal.image.shape[:2]
        fields["image"] = {"encoding": "raw", "height": height, "width": width, "data": goal.image.tobytes()}
    return fields
