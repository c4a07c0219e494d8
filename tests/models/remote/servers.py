"""Model servers for tests: the stub in a separate process, and a scripted server."""

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as serve_websocket

from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.vsnbench_policy import pack, unpack
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

ROOT = Path(__file__).resolve().parents[3]
STUB = Path(vsnbench_policy.__file__)
PATIENCE_S = 120.0
CARD = {"name": "scripted", "goals": None, "sensors": ["rgb"], "settings": {}, "deterministic": True}
CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.5)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def await_port(port: int, process: subprocess.Popen[bytes] | None = None, patience_s: float = PATIENCE_S) -> None:
    give_up = time.monotonic() + patience_s
    while time.monotonic() < give_up:
        with socket.socket() as probe:
            probe.settimeout(0.2)
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        assert process is None or process.poll() is None, "the server ended"
        time.sleep(0.02)
    raise AssertionError(f"nothing listens on {port}")


@contextmanager
def stub_server(
    source: str,
    directory: Path,
    *arguments: str,
    port: int | None = None,
    token: str = "",
    name: str = "Model",
    python: Path | None = None,
    stub: Path = STUB,
) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Serve a class `Model` with the stub, in its own directory; yield address and process."""
    (directory / "served_model.py").write_text(source, encoding="utf-8")
    (directory / STUB.name).write_bytes(stub.read_bytes())
    number = port or free_port()
    # Bytecode of a source that a test replaces within a second would still count as current.
    environment = {**os.environ, "VSNBENCH_TOKEN": token, "PYTHONPATH": "", "PYTHONDONTWRITEBYTECODE": "1"}
    with (directory / "server.log").open("ab") as log:
        process = subprocess.Popen(
            [
                str(python or sys.executable),
                STUB.name,
                *arguments,
                *([] if arguments else [f"served_model:{name}"]),
                "--port",
                str(number),
            ],
            cwd=directory,
            env=environment,
            stderr=log,
        )
    try:
        await_port(number, process)
        yield f"ws://127.0.0.1:{number}", process
    finally:
        process.kill()
        process.wait()


Answer = Callable[[ServerConnection, dict[str, Any]], None]


@contextmanager
def scripted_server(answer: Answer, greeting: dict[str, Any] | bytes | None = None) -> Iterator[str]:
    """Serve a card (or another greeting), and then the answers of a function to each message."""
    first = {"type": "card", "wire": 2, "card": CARD, "jpeg": False} if greeting is None else greeting

    def handle(connection: ServerConnection) -> None:
        connection.recv()
        connection.send(first if isinstance(first, bytes) else pack(first))
        for content in connection:
            message = unpack(content)
            if message["type"] == "bye":
                return
            answer(connection, message)

    with serve_websocket(handle, "127.0.0.1", 0, compression=None, max_size=None, close_timeout=0.2) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()
        thread.join(5.0)


def look(width: int = 64, height: int = 48) -> Observation:
    """Return an observation with an image, depth with holes, and a pose."""
    rng = np.random.default_rng(5)
    depth_m = rng.uniform(0.5, 5.0, (height, width)).astype(np.float32)
    depth_m[: height // 4] = np.nan
    camera = CAMERA.resized(width, height)
    rgb = rng.integers(0, 256, (height, width, 3), np.uint8)
    return Observation(rgb=rgb, depth_m=depth_m, pose=Pose(1.0, -0.5, 0.25), stamp_s=12.5, camera=camera)
