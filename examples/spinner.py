"""The smallest policy: it turns once around and stops.

vsnbench run --model examples.spinner:Spinner --goal chair --starts 1-3
"""

from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation


class Spinner:
    """Needs no sensor at all, so it is shown none."""

    card = ModelCard("spinner")

    def reset(self, goal: str, seed: int) -> None:
        """Begin an episode: forget the last one."""
        self.turns = 0

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        self.turns += 1
        return Decision(Action.STOP if self.turns > 12 else Action.TURN_LEFT)
