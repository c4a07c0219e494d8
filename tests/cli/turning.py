"""Policies for tests that need a long episode, or a broken model."""

import os
import subprocess
import time
from pathlib import Path

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation


class Turning(Policy):
    """Turns on the spot for ever."""

    card = ModelCard("turning")

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.TURN_LEFT)


class Broken(Turning):
    """Fails at the first look."""

    card = ModelCard("broken")

    def act(self, observation: Observation) -> Decision:
        raise RuntimeError("weights are on holiday")


class Loaded(Turning):
    """Turns, with weights and settings that the command line hands it."""

    card = ModelCard("loaded")

    def __init__(self, weights: Path, model_config: Path | None = None) -> None:
        self.loaded = weights.read_bytes(), model_config.read_bytes() if model_config else b""


class Exiting(Turning):
    """Ends its process, with the exit code of success."""

    card = ModelCard("exiting")

    def act(self, observation: Observation) -> Decision:
        os._exit(0)


class EndlessClose(Turning):
    """Answers STOP, and never returns from `close`."""

    card = ModelCard("endless-close")

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)

    def close(self) -> None:
        while True:
            time.sleep(0.01)


class Forking(Turning):
    """Leaves a process behind at every step, whose parent has ended."""

    card = ModelCard("forking")

    def act(self, observation: Observation) -> Decision:
        subprocess.run(["sh", "-c", "setsid sleep 600 & echo $! >> $FORKED"], check=True)
        return Decision(Action.STOP)
