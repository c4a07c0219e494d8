"""The model `random`: every action uniformly among the four, like the test client of the paper's software."""

import numpy as np

from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision, Diagnostics
from vsnbench.protocol.observation import Observation

_ACTIONS = (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class RandomWalk:
    """Looks at nothing; the lower bound that any model should clear."""

    def __init__(self) -> None:
        self.card = ModelCard(name="random")
        self._random = np.random.default_rng(0)

    def reset(self, goal: str, seed: int) -> None:  # noqa: ARG002 - it looks for nothing
        """Start an episode; the whole sequence of actions follows from `seed`."""
        self._random = np.random.default_rng(seed)

    def act(self, observation: Observation) -> Decision:  # noqa: ARG002 - it looks at nothing
        """Return one of STOP, MOVE_FORWARD, TURN_LEFT, TURN_RIGHT, each with probability 1/4."""
        share = 1 / len(_ACTIONS)
        action = _ACTIONS[int(self._random.integers(len(_ACTIONS)))]
        return Decision(action, diagnostics=Diagnostics(probabilities={each.value: share for each in _ACTIONS}))
