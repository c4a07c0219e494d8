"""The smallest policy: it turns once around and stops.

vsnbench run --model examples.spinner:Spinner --goal chair --starts 1-3
"""

from vsnbench import Action, Decision, ModelCard, Observation, Policy


class Spinner(Policy):
    """Needs no sensors, so it receives none."""

    card = ModelCard("spinner")

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode and forget the previous one."""
        self.turns = 0

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        self.turns += 1
        return Decision(Action.STOP if self.turns > 12 else Action.TURN_LEFT)
