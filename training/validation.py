"""Measures the success rate on validation sites, without physics."""

from collections.abc import Sequence

import numpy as np

from training.flat_world import FlatWorld
from training.networks import NetworkStudent
from training.recipe import Recipe
from training.rollout import evaluate
from training.stage import Row
from vsnbench.models.pirlnav.network import PIRLNavNetwork


class Validator:
    """Validation episodes, the same in every measurement."""

    def __init__(self, recipe: Recipe, seeds: Sequence[int], episodes: int) -> None:
        """Prepare the sites of some seeds, with a number of episodes in each."""
        self._recipe, self._seeds, self._episodes = recipe, seeds, episodes
        self._worlds: dict[int, FlatWorld] = {}

    def examine(self, network: PIRLNavNetwork) -> Row:
        """Run the episodes with sampled actions; return successes and stops over all of them."""
        was_training = network.training
        outcomes = []
        for seed in self._seeds:
            if seed not in self._worlds:
                self._worlds[seed] = FlatWorld(self._recipe, seed)
            rng = np.random.default_rng([self._recipe.seed, seed, 2])
            student = NetworkStudent(network, seed)
            limit = self._recipe.demonstrations.max_actions
            outcomes.append(evaluate(self._worlds[seed], self._episodes, student, rng, limit))
        network.train(was_training)
        episodes = sum(outcome.episodes for outcome in outcomes)
        return {
            "validation_episodes": episodes,
            "validation_successes": sum(outcome.successes for outcome in outcomes),
            "validation_stops": sum(outcome.stops for outcome in outcomes),
            "validation_mean_actions": sum(outcome.actions for outcome in outcomes) / episodes,
        }
