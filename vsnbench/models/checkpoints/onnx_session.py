"""Opens ONNX networks in onnxruntime on a CPU, without its telemetry."""

import os
from pathlib import Path
from typing import Any


def open_session(network: bytes | Path, threads: int | None) -> Any:
    """Return an `onnxruntime.InferenceSession` of an ONNX file or of its content.

    onnxruntime (1.32) stores a device id in the user's cache and uploads usage data unless this is switched off before
    it is imported. An operator has a number of threads; None for onnxruntime's default.

    Raises:
        Exception: onnxruntime cannot open it; its errors have no common base class.
    """
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    import onnxruntime

    onnxruntime.disable_telemetry_events()
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.inter_op_num_threads = 1
    if threads is not None:
        options.intra_op_num_threads = threads
    # Threads that spin between steps would take processor time from the control of the robot.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    content = network if isinstance(network, bytes) else str(network)
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
