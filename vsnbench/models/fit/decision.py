"""Which decisions a model may give: those on its card, within the limits of the robot's base.

`run` and `models check` both use this, so that a check fails on what would void a trial.
"""

from dataclasses import replace

from vsnbench.errors import DecisionError
from vsnbench.models.contract import ModelCard
from vsnbench.models.task import RobotFacts
from vsnbench.values.decision import Decision
from vsnbench.values.decision_check import checked_decision
from vsnbench.values.movement import TILTS, Action, Movement, Velocity


def fitting_decision(answer: object, card: ModelCard, robot: RobotFacts | None = None) -> Decision:
    """Return a validated copy of a model's answer, with LOOK_UP and LOOK_DOWN replaced as the card states.

    Tilts among the parts of a chunk stay; `without_tilt` replaces them when the parts are executed.

    Args:
        answer: what the model returned.
        card: the model's card.
        robot: the robot that executes the decision; None if it is not known.

    Raises:
        DecisionError: it is not a decision, its kind is not on the card, the card does not map its tilt, or the base
            does not reach its velocity or cannot move sideways.
    """
    decision = checked_decision(answer)
    if unstated := decision.kinds - card.action_kinds:
        raise DecisionError(
            f"answered with {', '.join(sorted(unstated))}, but its card states {', '.join(sorted(card.action_kinds))}",
            advice="add the kind to the card's action_kinds",
        )
    for movement in (decision.movement, *decision.parts):
        if isinstance(movement, Velocity) and robot is not None:
            _check_velocity(movement, robot)
        elif isinstance(movement, Movement) and movement.goes_sideways and robot and not robot.max_lateral_m_s:
            raise DecisionError(f"answered with a {movement.kind}, and this base cannot move sideways")
    for part in decision.parts:
        without_tilt(part, card)
    return decision if decision.parts else without_tilt(decision, card)


def without_tilt(decided: Decision | Action | Movement, card: ModelCard) -> Decision:
    """Return a decision, or a part of a chunk, with LOOK_UP and LOOK_DOWN replaced as the card states.

    Raises:
        DecisionError: the card replaces it by no other action.
    """
    decision = decided if isinstance(decided, Decision) else Decision(decided)
    if decision.action not in TILTS:
        return decision
    if decision.action not in card.action_map:
        raise DecisionError(
            f"answered with {decision.action}, and no robot tilts its camera",
            advice=f"map it on the card, for example action_map={{Action.{decision.action}: Action.NOOP}}",
        )
    return replace(decision, action=card.action_map[decision.action])


def _check_velocity(velocity: Velocity, robot: RobotFacts) -> None:
    limits = (
        (velocity.linear_m_s, robot.max_linear_m_s, "m/s"),
        (velocity.angular_rad_s, robot.max_angular_rad_s, "rad/s"),
        (velocity.lateral_m_s, robot.max_lateral_m_s, "m/s to the side"),
    )
    if velocity.lateral_m_s and not robot.max_lateral_m_s:
        raise DecisionError(
            f"answered with {velocity.lateral_m_s:.4g} m/s to the side, and this base cannot move sideways"
        )
    for asked, limit, unit in limits:
        if abs(asked) > limit * (1 + 1e-6):
            raise DecisionError(f"a velocity of {asked:.4g} {unit} exceeds this base's maximum of {limit:g} {unit}")
