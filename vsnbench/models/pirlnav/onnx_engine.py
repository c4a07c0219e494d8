"""Runs the network in onnxruntime on a CPU, with or without PyTorch."""

from importlib.metadata import version
from typing import Any

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.onnx_session import open_session
from vsnbench.models.pirlnav.checkpoint import Checkpoint
from vsnbench.models.pirlnav.engine import Engine, StepInput, StepOutput
from vsnbench.models.pirlnav.onnx_graph import network_file


class OnnxEngine(Engine):
    """An onnxruntime session with the memory of the episode."""

    def __init__(self, checkpoint: Checkpoint, threads: int) -> None:
        """Write the network of a checkpoint as ONNX and open it.

        Raises:
            ModelError: onnxruntime cannot open it.
        """
        sizes = checkpoint.architecture
        try:
            self._session: Any = open_session(network_file(sizes, checkpoint.weights), threads)
        except Exception as error:  # onnxruntime's exceptions have no other public base
            raise ModelError(
                f"onnxruntime cannot open the network of {checkpoint.path}: {str(error).partition(chr(10))[0][:160]}",
                advice="set `runtime: torch` in --model-config",
            ) from error
        self.label = f"onnxruntime {version('onnxruntime')} on cpu, {threads} threads"
        self.memory = np.zeros((sizes.recurrent_layers, 1, sizes.hidden_size), np.float32)

    def step(self, step: StepInput) -> StepOutput:
        """Run one step."""
        logits, value, self.memory = self._session.run(
            None,
            {
                "image": step.image[None],
                "gps": np.array([step.gps_m], np.float32),
                "compass": np.array([[step.compass_rad]], np.float32),
                "goal": np.array([step.goal], np.int64),
                "previous": np.array([step.previous_index], np.int64),
                "mask": np.array([[0.0 if step.begins else 1.0]], np.float32),
                "hidden": self.memory,
            },
        )
        return StepOutput(logits[0], float(value[0, 0]))
