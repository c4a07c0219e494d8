"""Kinds of goals and answers and assumed step sizes of a model, as rows and as JSON fields."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsnbench.models.contract import ModelCard


def card_rows(card: "ModelCard | None") -> list[tuple[str, str]]:
    """Return kinds of goals and answers, and the step sizes that the model assumes."""
    from vsnbench.models.step_sizes import assumed_steps

    if card is None:
        unknown = "stated when the model is created"
        return [("goal kinds", unknown), ("answers", unknown), ("assumed steps", unknown)]
    return [
        ("goal kinds", ", ".join(sorted(card.goal_kinds))),
        ("answers", ", ".join(sorted(card.action_kinds))),
        ("assumed steps", assumed_steps(card) or "none"),
    ]


def card_json(card: "ModelCard | None") -> dict[str, Any]:
    """Return the same as JSON fields; None if they are unknown."""
    return {
        "goal_kinds": None if card is None else sorted(card.goal_kinds),
        "action_kinds": None if card is None else sorted(card.action_kinds),
        "forward_m": None if card is None else card.forward_m,
        "turn_deg": None if card is None else card.turn_deg,
    }
