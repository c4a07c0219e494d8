"""Policies for tests that need a long episode, or a broken model."""

import os
import subprocess
import time
from pathlib import Path

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor


class Turning(Policy):
    """Turns on the spot forever."""

    card = ModelCard("turning")

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.TURN_LEFT)


class Broken(Turning):
    """Fails at the first observation."""

    card = ModelCard("broken")

    def act(self, observation: Observation) -> Decision:
        raise RuntimeError("weights are on holiday")


class Loaded(Turning):
    """Turns, and accepts weights and settings from the command line."""

    card = ModelCard("loaded")

    def __init__(self, weights: Path, model_config: Path | None = None) -> None:
        self.loaded = weights.read_bytes(), model_config.read_bytes() if model_config else b""


class Exiting(Turning):
    """Ends its process, with the exit code of success."""

    card = ModelCard("exiting")

    def act(self, observation: Observation) -> Decision:
        os._exit(0)


class EndlessClose(Turning):
    """Returns STOP, and never returns from `close`."""

    card = ModelCard("endless-close")

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)

    def close(self) -> None:
        while True:
            time.sleep(0.01)


class Forking(Turning):
    """Leaves an orphaned process behind at each step."""

    card = ModelCard("forking")

    def act(self, observation: Observation) -> Decision:
        subprocess.run(["sh", "-c", "setsid sleep 600 & echo $! >> $FORKED"], check=True)
        return Decision(Action.STOP)


class Narrow(Turning):
    """Declares a trained field of view of 40°, and stops immediately with the received camera in its details."""

    card = ModelCard(
        "narrow",
        sensors=frozenset({Sensor.RGB, Sensor.DEPTH}),
        camera=TrainedCamera(mount_height_m=0.88, tilt_deg=5, horizontal_fov_deg=40, width=320, height=240),
    )

    def act(self, observation: Observation) -> Decision:
        assert observation.depth_m is not None
        shapes = {"rgb": list(observation.rgb.shape[:2]), "depth": list(observation.depth_m.shape)}
        return Decision(Action.STOP, diagnostics=Diagnostics(details={**shapes, "camera": vars(observation.camera)}))
