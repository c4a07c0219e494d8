"""The model `random`: uniformly random actions, like the test client of the paper's software."""

import numpy as np

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation

_ACTIONS = (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class RandomWalk(Policy):
    """Uses no sensor: a lower bound for models."""

    card = ModelCard(name="random", goal_kinds=frozenset(GoalKind))

    def __init__(self) -> None:
        self._random = np.random.default_rng(0)

    def reset(self, goal: str, seed: int) -> None:  # noqa: ARG002 - it does not search
        """Start an episode. The sequence of actions follows from `seed`."""
        self._random = np.random.default_rng(seed)

    def next_goal(self, goal: str) -> None:
        """Go on: it does not search."""

    def act(self, observation: Observation) -> Decision:  # noqa: ARG002 - it uses no sensor
        """Return one of STOP, MOVE_FORWARD, TURN_LEFT, TURN_RIGHT, each with probability 1/4."""
        share = 1 / len(_ACTIONS)
        action = _ACTIONS[int(self._random.integers(len(_ACTIONS)))]
        return Decision(action, diagnostics=Diagnostics(probabilities={item.value: share for item in _ACTIONS}))
