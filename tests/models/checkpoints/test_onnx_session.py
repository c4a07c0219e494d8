"""onnxruntime runs without telemetry."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from vsnbench.models.checkpoints.onnx_file import FLOAT, OnnxGraph

OPEN = """
import sys
from pathlib import Path
from vsnbench.models.checkpoints.onnx_session import open_session
session = open_session(Path(sys.argv[1]), 1)
print(session.run(None, {"x": __import__("numpy").ones(2, "float32")})[0].tolist())
"""


def test_a_session_stores_no_device_id_and_no_usage_data(tmp_path: Path) -> None:
    graph = OnnxGraph()
    graph.add("Add", ["x", graph.tensor("one", np.ones(2, np.float32))], "y")
    network = tmp_path / "add.onnx"
    network.write_bytes(graph.file("add", {"x": (FLOAT, (2,))}, {"y": (FLOAT, (2,))}, versions=(8, 17)))
    home = tmp_path / "home"
    home.mkdir()
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("XDG_", "ORT_"))}
    command = [sys.executable, "-c", OPEN, str(network)]
    done = subprocess.run(command, env=environment | {"HOME": str(home)}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "[2.0, 2.0]\n"), done.stderr
    assert [path for path in home.rglob("*") if "onnxruntime" in path.name] == []
