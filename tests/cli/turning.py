"""Policies for tests that need a long episode, or a broken model."""

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
