"""Runs the network in onnxruntime on a CPU; the exported graph is cached by the hash of its weights."""

import io
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.disk_cache import cache_directory
from vsnbench.models.pirlnav.engine import Engine, StepInput, StepOutput
from vsnbench.models.pirlnav.network import PIRLNavNetwork

logger = logging.getLogger(__name__)

_EXPORT_FORMAT = 1
"""Increased whenever the exported graph changes, so that older cache files are not used."""
_OPSET = 17
_INPUTS = ("image", "gps", "compass", "goal", "previous", "mask", "hidden")
_OUTPUTS = ("logits", "value", "hidden_after")


def exported_graph(network: PIRLNavNetwork, weights_sha256: str) -> Path:
    """Return the file with the network's ONNX graph, exporting it on first use.

    Raises:
        ModelError: the cache cannot be written.
    """
    path = cache_directory() / "onnx" / f"pirlnav-{weights_sha256}-v{_EXPORT_FORMAT}.onnx"
    if not path.is_file():
        logger.info("exporting the network to %s", path)
        write_atomic(path, _export(network), ModelError)
    return path


def _export(network: PIRLNavNetwork) -> bytes:
    import torch

    sizes = network.architecture
    example = (
        torch.zeros(1, sizes.image_size_px, sizes.image_size_px, 3),
        torch.zeros(1, 2),
        torch.zeros(1, 1),
        torch.zeros(1, dtype=torch.int64),
        torch.zeros(1, dtype=torch.int64),
        torch.zeros(1, 1),
        torch.zeros(sizes.recurrent_layers, 1, sizes.hidden_size),
    )
    buffer = io.BytesIO()
    with warnings.catch_warnings(), torch.no_grad():
        # The tracing exporter writes GRU and group norm in a form that onnxruntime runs well, and needs no further
        # package. Its warnings about deprecation and batches do not apply.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            example,
            buffer,  # type: ignore[arg-type]  # a file object is documented and works; the annotation names paths only
            input_names=list(_INPUTS),
            output_names=list(_OUTPUTS),
            opset_version=_OPSET,
            dynamo=False,
        )
    return buffer.getvalue()


class OnnxEngine(Engine):
    """An onnxruntime session with the memory of the episode."""

    def __init__(self, graph: Path, network: PIRLNavNetwork, threads: int) -> None:
        """Open an exported graph.

        Raises:
            ModelError: onnxruntime cannot open it.
        """
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        # Threads that spin between steps would take processor time from the control of the robot.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session: Any = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's exceptions have no other public base
            raise ModelError(
                f"onnxruntime cannot open {graph}: {str(error).partition(chr(10))[0][:160]}",
                advice="set `runtime: torch` in --model-config",
            ) from error
        sizes = network.architecture
        self.label = f"onnxruntime {onnxruntime.__version__} on cpu, {threads} threads"
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
