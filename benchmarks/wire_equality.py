"""Compares the decisions of PIRLNav in process and over a WebSocket, bit by bit.

Two runs over ROS never receive the same images, so a run with a remote model cannot be compared with a run without one.
This policy contains both models: it sends every observation to both, and the first difference between their decisions
ends the run.

    cd benchmarks
    export OMP_NUM_THREADS=1                                  # the last bits depend on the number of threads
    vsnbench models serve pirlnav --weights embedded --port 8799 &
    vsnbench run --model wire_equality:LocalAndRemote --goal chair [--robot turtlebot2]
"""

import logging
import os
from dataclasses import replace

from vsnbench.errors import ModelError
from vsnbench.models.contract import Policy
from vsnbench.models.registry import create_policy
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation

ADDRESS = os.environ.get("VSNBENCH_SERVED_PIRLNAV", "ws://127.0.0.1:8799")
logger = logging.getLogger("vsnbench.wire_equality")


class LocalAndRemote(Policy):
    """PIRLNav in this process and PIRLNav behind a server."""

    def __init__(self) -> None:
        self._here = create_policy("pirlnav", weights="embedded")
        self._there = create_policy(ADDRESS)
        self.card = replace(self._here.card, name="pirlnav-twice")
        self._same = 0

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode with both models."""
        self._here.reset(goal, seed)
        self._there.reset(goal, seed)
        logger.warning("%d identical decisions so far", self._same)

    def act(self, observation: Observation) -> Decision:
        """Return the decision of both models.

        Raises:
            ModelError: their actions or probabilities differ.
        """
        here, there = self._here.act(observation), self._there.act(observation)
        ours, theirs = dict(here.diagnostics.probabilities), dict(there.diagnostics.probabilities)
        if here.action != there.action or ours != theirs or not ours:
            raise ModelError(f"decision {self._same + 1} differs: {here.action} {ours}, {there.action} {theirs}")
        self._same += 1
        return there

    def close(self) -> None:
        """Close both models."""
        logger.warning("%d decisions, all identical", self._same)
        for policy in (self._here, self._there):
            policy.close()
