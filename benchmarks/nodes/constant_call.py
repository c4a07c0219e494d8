"""Model whose calls take 100 ms for any number of observations, for `served_scale.py`."""

import random
import time
from collections.abc import Sequence

from vsnbench import Action, BatchPolicy, Decision, ModelCard, Observation, Sensor

CALL_S = 0.1
CHOICES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class ConstantCall(BatchPolicy):
    """Drives at random, with the same duration for any number of observations."""

    card = ModelCard("constant-call", sensors=frozenset({Sensor.RGB}))

    def new_state(self, goal: str, seed: int) -> random.Random:  # noqa: ARG002
        """Return the random generator of an episode."""
        return random.Random(seed)

    def act_batch(
        self,
        observations: Sequence[Observation],  # noqa: ARG002
        states: Sequence[random.Random],
    ) -> list[Decision]:
        """Return an action for each episode."""
        time.sleep(CALL_S)
        return [Decision(state.choice(CHOICES)) for state in states]
