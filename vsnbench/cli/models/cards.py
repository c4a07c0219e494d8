"""The card of a model as rows of text and as JSON fields."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsnbench.models.contract import ModelCard
    from vsnbench.values.robot_profile import RobotProfile

UNKNOWN = "stated when the model is created"


def card_rows(card: "ModelCard | None", profile: "RobotProfile | None" = None) -> list[tuple[str, str]]:
    """Return goals, answers, assumed step sizes and camera; with a profile, the comparison with the robot's camera."""
    from vsnbench.models.fit.camera import comparison_text
    from vsnbench.models.step_sizes import assumed_steps

    if card is None:
        return [(name, UNKNOWN) for name in ("goal kinds", "answers", "assumed steps", "trained camera")]
    compared = [] if profile is None else [("camera", comparison_text(card, profile.name, profile.camera))]
    return [
        ("goal kinds", ", ".join(sorted(card.goal_kinds))),
        ("answers", ", ".join(sorted(card.action_kinds))),
        ("assumed steps", assumed_steps(card) or "none"),
        ("trained camera", card.camera.text if card.camera is not None else "not stated"),
        *compared,
    ]


_SHOWN = ("goal_kinds", "action_kinds", "forward_m", "turn_deg", "camera")


def card_json(card: "ModelCard | None", *others: str) -> dict[str, Any]:
    """Return goals, answers, assumed step sizes, camera and other fields as JSON fields; None if they are unknown."""
    values = {} if card is None else card.as_json()
    return {name: values.get(name) for name in (*others, *_SHOWN)}
