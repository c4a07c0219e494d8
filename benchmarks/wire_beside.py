"""A policy that asks two and lets neither differ: PIRLNav in this process and PIRLNav behind a WebSocket.

Over ROS no two runs see the same pixels, so a run over the wire cannot be compared with one without it. This policy is
both at once: every observation goes to both, and the first decision that is not the same to the last bit ends the run.

    cd benchmarks
    export OMP_NUM_THREADS=1                                  # the last bits depend on the number of threads
    vsnbench models serve pirlnav --weights embedded --port 8799 &
    vsnbench run --model wire_beside:Beside --goal chair [--robot turtlebot2]
"""

import logging
import os
from dataclasses import replace

from vsnbench.errors import ModelError
from vsnbench.models.contract import Policy
from vsnbench.models.registry import create_policy
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation

ADDRESS = os.environ.get("VSNBENCH_BESIDE", "ws://127.0.0.1:8799")
logger = logging.getLogger("vsnbench.beside")


class Beside(Policy):
    """PIRLNav twice."""

    def __init__(self) -> None:
        self._here = create_policy("pirlnav", weights="embedded")
        self._there = create_policy(ADDRESS)
        self.card = replace(self._here.card, name="pirlnav-twice")
        self._same = 0

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode on both."""
        self._here.reset(goal, seed)
        self._there.reset(goal, seed)
        logger.warning("%d decisions the same so far", self._same)

    def act(self, observation: Observation) -> Decision:
        """Return what both answer.

        Raises:
            ModelError: their actions or their probabilities differ.
        """
        here, there = self._here.act(observation), self._there.act(observation)
        ours, theirs = dict(here.diagnostics.probabilities), dict(there.diagnostics.probabilities)
        if here.action != there.action or ours != theirs or not ours:
            raise ModelError(f"decision {self._same + 1} differs: {here.action} {ours}, {there.action} {theirs}")
        self._same += 1
        return there

    def close(self) -> None:
        """Let both go."""
        logger.warning("%d decisions, all the same", self._same)
        for policy in (self._here, self._there):
            policy.close()
