"""Policies for tests that need a long episode, or a broken model."""

from pathlib import Path

from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation


class Turning:
    """Turns on the spot for ever."""

    card = ModelCard("turning")

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.TURN_LEFT)


class Broken(Turning):
    """Fails at the first look."""

    card = ModelCard("broken")

    def act(self, observation: Observation) -> Decision:
        raise RuntimeError("weights are on holiday")


class Loaded(Turning):
    """Turns, with weights and settings that the command line hands it."""

    card = ModelCard("loaded")

    def __init__(self, weights: Path, model_config: Path | None = None) -> None:
        self.loaded = weights.read_bytes(), model_config.read_bytes() if model_config else b""
