"""Sequences of goals: the explorer of frontier.py, which keeps its map and remembers where it has seen each category.

Its card says so with `GoalKind.SEQUENCE`, and it receives each further goal by `next_goal`. A model without that begins
again at each goal, as `examples.frontier:Frontier` does. Simulation only, as frontier.py.

vsnbench run --model examples.sequence:Rememberer --site examples/goals.yaml --goal chair-first
"""

from typing import Any

import numpy as np

from examples.depth_map import CELLS
from examples.frontier import SENSORS, Frontier
from vsnbench import ActionKind, GoalKind, ModelCard, Observation


class Rememberer(Frontier):
    """Goes straight to what it has seen on the way to earlier goals."""

    card = ModelCard(
        "rememberer",
        sensors=SENSORS,
        action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT}),
        goal_kinds=frozenset({GoalKind.CATEGORY, GoalKind.SEQUENCE}),
    )

    def reset(self, goal: str, seed: int) -> None:
        """Forget the last episode."""
        super().reset(goal, seed)
        self.places: dict[str, Any] = {goal: self.stop}

    def next_goal(self, goal: str) -> None:
        """Search the next goal with the same map."""
        self.goal = goal
        self.stop = self.places.setdefault(goal, np.zeros(CELLS**2, bool))
        self.tried[:] = 0

    def mark(self, observation: Observation, lens: complex, rays: Any) -> None:
        """Mark where to stop at what the image shows of each category."""
        labels = observation.instances
        if labels is None:
            raise ValueError("the card asks for labels")
        for category in set(labels.categories.values()):
            numbers = [number for number, name in labels.categories.items() if name == category]
            places = self.places.setdefault(category, np.zeros(CELLS**2, bool))
            places[self.stops(np.isin(labels.ids, numbers), lens, rays)] = True
