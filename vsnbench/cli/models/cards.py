"""Kinds of goals and answers and assumed step sizes of a model, as rows and as JSON fields."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsnbench.models.contract import ModelCard
    from vsnbench.values.robot_profile import RobotProfile


def card_rows(card: "ModelCard | None") -> list[tuple[str, str]]:
    """Return kinds of goals and answers, and the step sizes that the model assumes."""
    from vsnbench.models.step_sizes import assumed_steps

    if card is None:
        unknown = "stated when the model is created"
        return [(name, unknown) for name in ("goal kinds", "answers", "assumed steps", "trained camera")]
    return [
        ("goal kinds", ", ".join(sorted(card.goal_kinds))),
        ("answers", ", ".join(sorted(card.action_kinds))),
        ("assumed steps", assumed_steps(card) or "none"),
        ("trained camera", card.camera.text if card.camera is not None else "not stated"),
    ]


def card_json(card: "ModelCard | None") -> dict[str, Any]:
    """Return the same as JSON fields; None if they are unknown."""
    return {
        "goal_kinds": None if card is None else sorted(card.goal_kinds),
        "action_kinds": None if card is None else sorted(card.action_kinds),
        "forward_m": None if card is None else card.forward_m,
        "turn_deg": None if card is None else card.turn_deg,
        "camera": None if card is None or card.camera is None else card.camera.model_dump(mode="json"),
    }


def comparison_rows(card: "ModelCard | None", profile: "RobotProfile | None") -> list[tuple[str, str]]:
    """Return the comparison of the trained camera with a robot's; nothing if either is unknown."""
    from vsnbench.models.camera_fit import comparison_text

    if card is None or profile is None:
        return []
    return [("camera", comparison_text(card, profile.name, profile.camera))]


def comparison_json(card: "ModelCard | None", profile: "RobotProfile | None") -> dict[str, Any]:
    """Return the same as JSON fields; None if the cameras were not compared."""
    from vsnbench.models.camera_fit import camera_differences

    if card is None or card.camera is None or profile is None:
        return {"camera_differences": None}
    return {"camera_differences": [asdict(found) for found in camera_differences(card, profile.camera)]}
