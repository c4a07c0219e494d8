"""An image-goal matcher by colour histogram: it looks for the colours of the middle of the photograph.

A colour counts as the goal's if it is common in the middle of the photograph, and rare at its edges and in what the
robot has seen. The matcher explores like examples/frontier.py until it sees a large spot of such colours, and drives
there. It needs no labels of the simulator. It fails where the goal has the colours of its surroundings.

vsnbench run --model examples.image_goal:HistogramMatcher --site examples/goals.yaml --goal photo-bed,photo-sofa
"""

from typing import Any, cast

import numpy as np

from examples.frontier import Frontier
from examples.instruction import hue_and_saturation, large_spots
from vsnbench import Decision, Goal, GoalKind, ModelCard, Observation, Sensor

HUES, SATURATIONS = 15, 5
LIKELIHOOD = 0.6
"""Least share of the goal in a colour's frequency that makes the colour one of the goal's."""
FREQUENCY = 0.005
"""Least frequency of a colour of the goal in the middle of the photograph."""


class HistogramMatcher(Frontier):
    """Drives to what has the colours of a photograph, by waypoints."""

    card = ModelCard(
        "histogram-matcher",
        sensors=frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}),
        action_kinds=Frontier.card.action_kinds,
        goal_kinds=frozenset({GoalKind.IMAGE}),
    )

    def reset(self, goal: str, seed: int) -> None:
        """Compute the histograms of the photograph's middle and edges."""
        super().reset(goal, seed)
        photograph = cast("Goal", goal).image  # a run gives a Goal, which is also a string
        colours = colour_numbers(photograph)
        height, width = colours.shape
        middle = np.zeros(colours.shape, bool)
        middle[height // 4 : height * 7 // 8, width // 4 : width * 3 // 4] = True
        self.wanted, self.edges = histogram(colours[middle]), histogram(colours[~middle])
        self.views: list[Any] = []

    def act(self, observation: Observation) -> Decision:
        """Add the view to what the robot has seen, then explore."""
        self.views.append(histogram(colour_numbers(observation.rgb)))
        return super().act(observation)

    def goal_pixels(self, observation: Observation) -> Any:
        """Return which pixels are part of a large spot of the goal's colours."""
        likelihood = self.wanted / (self.wanted + self.edges + np.mean(self.views, axis=0) + 1e-4)
        is_goal = (likelihood > LIKELIHOOD) & (self.wanted > FREQUENCY)
        return large_spots(is_goal[colour_numbers(observation.rgb)], observation)


def colour_numbers(rgb: Any) -> Any:
    """Return the bin of the histogram of each pixel: its hue and saturation."""
    hue_deg, saturation = hue_and_saturation(rgb)
    hues = (hue_deg * HUES / 360).astype(int) % HUES
    return hues * SATURATIONS + np.minimum(saturation * SATURATIONS, SATURATIONS - 1).astype(int)


def histogram(colours: Any) -> Any:
    """Return the frequency of each colour."""
    return np.bincount(colours.ravel(), minlength=HUES * SATURATIONS) / colours.size
