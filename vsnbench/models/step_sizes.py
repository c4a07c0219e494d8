"""Step sizes that a model assumes, and how a protocol differs from them."""

from vsnbench.models.contract import ModelCard
from vsnbench.protocol.parameters import ProtocolParameters


def assumed_steps(card: ModelCard) -> str:
    """Return the step sizes that a model assumes, such as `0.25 m and 30°`; empty if it assumes none."""
    sizes = ((card.forward_m, " m"), (card.turn_deg, "°"))
    return " and ".join(f"{size:g}{unit}" for size, unit in sizes if size is not None)


def wrong_assumptions(card: ModelCard, parameters: ProtocolParameters) -> list[str]:
    """Return how the steps that a model assumes on its card differ from the protocol's, one line each."""
    pairs = (
        ("moves", card.forward_m, parameters.forward_m, " m"),
        ("turns", card.turn_deg, parameters.turn_deg, "°"),
    )
    return [
        f"model {card.name} assumes {what} of {assumed:g}{unit}; protocol {parameters.name} has {actual:g}{unit}"
        for what, assumed, actual, unit in pairs
        if assumed is not None and assumed != actual
    ]
