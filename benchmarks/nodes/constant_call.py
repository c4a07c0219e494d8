"""A model that takes the same time for any number of observations, for benchmarks/served_scale.py."""

import random
import time
from collections.abc import Sequence

from vsnbench import Action, BatchPolicy, Decision, ModelCard, Observation, Sensor

CALL_S = 0.1
CHOICES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class ConstantCall(BatchPolicy):
    """Drives at random, and takes the same time for any number of observations."""

    card = ModelCard("constant-call", sensors=frozenset({Sensor.RGB}))

    def new_state(self, goal: str, seed: int) -> random.Random:  # noqa: ARG002
        """Return the random numbers of an episode."""
        return random.Random(seed)

    def act_batch(
        self,
        observations: Sequence[Observation],  # noqa: ARG002
        states: Sequence[random.Random],
    ) -> list[Decision]:
        """Return an action for each episode."""
        time.sleep(CALL_S)
        return [Decision(state.choice(CHOICES)) for state in states]
