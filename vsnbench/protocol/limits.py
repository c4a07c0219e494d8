"""Limits of an episode: what it has spent, and the budget that is left.

Time is the robot's: the durations of its movements on its own clock. On a real robot the model's thinking (wall time of
its inference) is added, because a real clock does not stop for it. A simulated robot's time passes only while it moves,
so that equal seeds give equal results on any machine.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.values.observation import Budget


@dataclass(frozen=True, slots=True)
class Spent:
    """What an episode has used so far."""

    actions: int = 0
    """Number of actions; STOP and blocked actions count."""
    driving_s: float = 0.0
    """Duration of the movements on the robot's clock."""
    thinking_s: float = 0.0
    """Wall time of the model's inference; 0 for a simulated robot."""
    path_m: float = 0.0
    """Length of the path in the site."""

    @property
    def time_s(self) -> float:
        """Time that counts towards the limit: driving and thinking."""
        return self.driving_s + self.thinking_s

    def after(self, *, driving_s: float, thinking_s: float, path_m: float) -> "Spent":
        """Return what is used after one more action."""
        return Spent(self.actions + 1, self.driving_s + driving_s, self.thinking_s + thinking_s, self.path_m + path_m)


def budget_left(spent: Spent, parameters: "ProtocolParameters") -> "Budget":
    """Return what is left of every limit; None for what is unlimited."""
    from vsnbench.values.observation import Budget

    actions, time_s, path_m = parameters.action_limit, parameters.time_limit_s, parameters.max_path_m
    return Budget(
        actions_left=None if actions is None else actions - spent.actions,
        time_left_s=None if time_s is None else max(0.0, time_s - spent.time_s),
        path_left_m=None if path_m is None else max(0.0, path_m - spent.path_m),
    )
