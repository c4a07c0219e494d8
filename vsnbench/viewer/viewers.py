"""Rerun's native viewer as a child process.

It listens on 127.0.0.1 only; Rerun's default is every interface. `CI` in its environment switches usage statistics off.
"""

import contextlib
import importlib.util
import os
import socket
import subprocess
import time
import urllib.parse
from pathlib import Path
from typing import Self

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.installation import command_to_add
from vsnbench.runtime.child_process import command_that_ends_with_parent

_LOOPBACK = "127.0.0.1"
_START_TIMEOUT_S = 20.0


def rerun_is_installed() -> bool:
    """Whether Rerun's Python package is installed."""
    return importlib.util.find_spec("rerun") is not None


def require_rerun() -> None:
    """Check that Rerun is installed.

    Raises:
        UsageError: `not-installed`, it is not.
    """
    if not rerun_is_installed():
        raise UsageError("Rerun is not installed", advice=command_to_add("viewer"), code="not-installed")


class Viewer:
    """A running viewer; a context manager that ends it. The process also ends with the thread that starts it.

    Raises:
        VsnbenchError: Rerun's program is missing or does not start.
    """

    how_to_end = "close its window or press Ctrl-C"

    def __init__(self, arguments: list[str], grpc_port: int, wait_port: int) -> None:
        """Start the process, and return when it listens on `wait_port`."""
        self.grpc_url = f"rerun+http://{_LOOPBACK}:{grpc_port}/proxy"
        """Address to which `EpisodeRecording` sends a live episode."""
        command = [str(_program()), "--bind", _LOOPBACK, "--port", str(grpc_port), *arguments]
        self._process = subprocess.Popen(
            command_that_ends_with_parent(command),
            env=os.environ | {"CI": "true", "RUST_LOG": "error"},
            stdin=subprocess.DEVNULL,
        )
        try:
            self._wait_until_listening(wait_port)
        except BaseException:
            Viewer.close(self)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def is_open(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    def wait(self) -> None:
        """Return when the user has closed the viewer."""
        self._process.wait()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _wait_until_listening(self, port: int) -> None:
        deadline = time.monotonic() + _START_TIMEOUT_S
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise VsnbenchError(
                    f"Rerun's viewer exited with code {self._process.returncode}",
                    advice="on a machine without a display, add --web",
                )
            with contextlib.suppress(OSError), socket.create_connection((_LOOPBACK, port), timeout=1):
                return
            time.sleep(0.02)
        raise VsnbenchError(
            f"Rerun's viewer did not start within {_START_TIMEOUT_S:g} s",
            advice="try again when the machine is less busy",
        )


def has_display() -> bool:
    """Whether a window can be opened."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_window(recording: Path | None = None) -> Viewer:
    """Open the native viewer with a recording, or waiting for live data.

    Raises:
        VsnbenchError: `no-display`, there is no display.
    """
    if not has_display():
        raise VsnbenchError("there is no display for Rerun's window", advice="add --web", code="no-display")
    port = free_port()
    return Viewer([str(recording)] if recording is not None else ["--expect-data-soon"], port, port)


def is_listening(grpc_url: str) -> bool:
    """Return whether a viewer still accepts live data at an address."""
    address = urllib.parse.urlsplit(grpc_url)
    try:
        with socket.create_connection((address.hostname or _LOOPBACK, address.port or 0), timeout=1):
            return True
    except OSError:
        return False


def free_port() -> int:
    """Return a free TCP port on 127.0.0.1."""
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def _program() -> Path:
    package = importlib.util.find_spec("rerun_cli")
    bundled = Path(package.origin).with_name("rerun") if package and package.origin else Path("rerun")
    program = Path(os.environ.get("RERUN_CLI_PATH") or bundled)
    if not program.is_file():
        raise VsnbenchError(
            f"Rerun's program {program} does not exist", advice=command_to_add("viewer"), code="not-installed"
        )
    return program
