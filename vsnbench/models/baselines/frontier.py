"""The model `frontier`: classical exploration, to the nearest unknown area until the goal is detected.

Depth, odometry and an object detector. Map, planner, detectors and the approach to the goal are those of `vlv`; nothing
is learned apart from the detector.
"""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.detectors.contract import Reliability
from vsnbench.models.vlv.map_regions import frontier_away_from
from vsnbench.models.vlv.planner import Planner, Point
from vsnbench.models.vlv.policy import MODULAR_CARD, ModularPolicy
from vsnbench.models.vlv.search import Search, explained
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.models.vlv.value.estimate import NoValue
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation

_COUNT_WITHIN_M: Final = 1.5
_MAX_TRIES: Final = 20
"""Actions near a frontier after which it is given up."""
_SMALLEST_CELLS: Final = 5
"""Side of the smallest unknown area to explore, in cells of the map."""
_SAME_FRONTIER_M: Final = 0.3


class Frontier(ModularPolicy):
    """The number that a learned model should beat."""

    card = replace(MODULAR_CARD, name="frontier")

    def __init__(self, model_config: str | Path | VLVSettings | None = None, device: str = "auto") -> None:
        """Open the detector that the settings choose.

        Raises:
            UsageError: a setting is invalid.
            ModelError: the detector's weights cannot be used.
        """
        super().__init__(NoValue(label=""), model_config, device)

    def _make_search(self, seed: int) -> Search:
        return FrontierSearch(self.settings, self._planner, seed, self._reliability)


class FrontierSearch(Search):
    """The state of an episode."""

    def __init__(self, settings: VLVSettings, planner: Planner, seed: int, reliability: Reliability) -> None:
        super().__init__(settings, planner, seed, reliability)
        self._tries: Counter[tuple[int, int]] = Counter()
        self._given_up: list[Point] = []

    def _look_for_goal(self, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        """Drive to the nearest frontier; look around if none can be reached."""
        if self._turns_left is None and self._scans == 0:
            return self._begin_scan()
        if self._turns_left:
            return self._scan_turn()
        self._turns_left = None
        avoided = [*self.graph.visited, *self._given_up]
        frontier = frontier_away_from(self.map, avoided, self.settings.visited_radius_m, _SMALLEST_CELLS)
        move = self._towards(frontier, observation, depth_m, "travel")
        if move is None or not move.diagnostics.path:
            self._given_up.clear()
            return self._begin_scan()
        end = move.diagnostics.path[-1]
        if math.dist(end, observation.pose.position) < _COUNT_WITHIN_M:
            key = (round(end[0] / _SAME_FRONTIER_M), round(end[1] / _SAME_FRONTIER_M))
            self._tries[key] += 1
            if self._tries[key] >= _MAX_TRIES:
                self._given_up.append(end)
        return explained(move.action, "travel", "to the nearest frontier", end, move.diagnostics.path)
