"""Rerun's viewer as a process of ours: the native window, or the web viewer behind a small server of our own.

Both listen on 127.0.0.1 only (Rerun's own default is every interface). Neither sends usage statistics: the native
viewer keeps still where `CI` is set, and the web viewer, which has no such switch, is served with a content security
policy that lets the page talk to this machine alone.
"""

import contextlib
import http.client
import importlib.util
import os
import re
import socket
import subprocess
import threading
import time
import urllib.parse
from pathlib import Path
from types import TracebackType
from typing import Self

from vsnbench import loopback
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.loopback import LOOPBACK
from vsnbench.workers import command_that_ends_with_parent

WEB_PORT = 9090
INSTALL = "pip install 'vsnbench[viewer]'"
START_TIMEOUT_S = 20.0
RECORDING_NAME = "episode.rrd"
_VIEWERS_FILE = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9]+)+")


def rerun_is_installed() -> bool:
    """Whether episodes can be copied for Rerun, and shown."""
    return importlib.util.find_spec("rerun") is not None


def require_rerun() -> None:
    """See that Rerun is there.

    Raises:
        UsageError: it is not; the message says how to install it.
    """
    if not rerun_is_installed():
        raise UsageError("Rerun is not installed, which shows episodes", advice=INSTALL)


class Viewer:
    """A running viewer; a context manager that ends it. It ends with the thread that opens it, too.

    Raises:
        VsnbenchError: Rerun's program is missing or does not start.
    """

    def __init__(self, arguments: list[str], grpc_port: int, waits_for: int) -> None:
        self.grpc_url = f"rerun+http://{LOOPBACK}:{grpc_port}/proxy"
        """Where `EpisodeRecording` can send an episode as it happens."""
        command = [str(_program()), "--bind", LOOPBACK, "--port", str(grpc_port), *arguments]
        self._process = subprocess.Popen(
            command_that_ends_with_parent(command),
            env=os.environ | {"CI": "true", "RUST_LOG": "error"},
            stdin=subprocess.DEVNULL,
        )
        try:
            self._wait_until_it_listens(waits_for)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def is_open(self) -> bool:
        """Whether its user has not closed it yet."""
        return self._process.poll() is None

    def wait(self) -> None:
        """Return when the viewer has been closed by its user."""
        self._process.wait()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _wait_until_it_listens(self, port: int) -> None:
        deadline = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise VsnbenchError(
                    f"Rerun's viewer ended at once with code {self._process.returncode}",
                    advice="without a display, --web serves it to a browser",
                )
            with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1):
                return
            time.sleep(0.02)
        raise VsnbenchError(
            f"Rerun's viewer did not start within {START_TIMEOUT_S:g} s",
            advice="try again when the machine is less busy",
        )


class WebViewer(Viewer):
    """The web viewer, served on 127.0.0.1; `address` is what a browser opens."""

    def __init__(self, port: int = WEB_PORT, recording: Path | None = None) -> None:
        grpc_port, upstream_port = free_port(), free_port()
        page = _ViewerPage(upstream_port, grpc_port, recording)
        try:
            self._server = loopback.LoopbackServer(port, page)
        except (OSError, OverflowError) as error:
            raise UsageError(f"cannot serve on {LOOPBACK}:{port} ({error})", advice="choose another port") from error
        self.address = page.address = self._server.address
        try:
            super().__init__(["--serve-web", "--web-viewer-port", str(upstream_port)], grpc_port, upstream_port)
        except BaseException:
            self._server.server_close()
            raise
        self._thread = threading.Thread(target=self._server.serve_forever, name="rerun-web", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the server and the viewer behind it."""
        thread: threading.Thread | None = getattr(self, "_thread", None)
        if thread is not None:
            self._server.shutdown()
            thread.join()
        self._server.server_close()
        super().close()


def has_display() -> bool:
    """Whether a window can be opened here."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_window(recording: Path | None = None) -> Viewer:
    """Open the native viewer, on a recording or waiting for one.

    Raises:
        VsnbenchError: there is no display here.
    """
    if not has_display():
        raise VsnbenchError(
            "there is no display here for Rerun's window", advice="--web serves it to a browser instead"
        )
    port = free_port()
    return Viewer([str(recording)] if recording is not None else ["--expect-data-soon"], port, port)


def is_listening(grpc_url: str) -> bool:
    """Return whether a viewer still takes episodes there."""
    address = urllib.parse.urlsplit(grpc_url)
    try:
        with socket.create_connection((address.hostname or LOOPBACK, address.port or 0), timeout=1):
            return True
    except OSError:
        return False


def free_port() -> int:
    """Return a TCP port on the loopback interface that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def _program() -> Path:
    package = importlib.util.find_spec("rerun_cli")
    shipped = Path(package.origin).with_name("rerun") if package and package.origin else Path("rerun")
    program = Path(os.environ.get("RERUN_CLI_PATH") or shipped)
    if not program.is_file():
        raise VsnbenchError(f"Rerun's viewer is not at {program}", advice=INSTALL)
    return program


class _ViewerPage:
    """The web viewer's files, passed on from Rerun's own server, and the recording that the page shows.

    The page's policy keeps it from calling anywhere but this machine. A finished recording is served from here, behind
    the address's token; what is sent live has to go through Rerun's own server, which knows no token, on a port that
    no other page's script may read from (Rerun refuses their origin).
    """

    def __init__(self, upstream_port: int, grpc_port: int, recording: Path | None) -> None:
        self.address = ""
        """Under which this site is served, once it is."""
        self._upstream_port = upstream_port
        self._grpc_port = grpc_port
        self._recording = recording

    def __call__(self, path: str, query: str) -> loopback.Answer:
        if not path:
            given = urllib.parse.parse_qsl(query, keep_blank_values=True)
            if "url" not in dict(given):
                # Lead the browser from the bare address to the one that names the data.
                named = urllib.parse.urlencode([("url", self._data_url), *given])
                return loopback.Answer(302, headers={"Location": f"{self.address}?{named}"})
        elif path == RECORDING_NAME and self._recording is not None:
            return loopback.file(self._recording, "application/octet-stream")
        elif not _VIEWERS_FILE.fullmatch(path):
            return loopback.NOT_FOUND
        return self._passed_on(path)

    @property
    def _data_url(self) -> str:
        if self._recording is not None:
            return self.address + RECORDING_NAME
        return f"rerun+http://{loopback.LOOPBACK}:{self._grpc_port}/proxy"

    def _passed_on(self, path: str) -> loopback.Answer:
        upstream = http.client.HTTPConnection(loopback.LOOPBACK, self._upstream_port, timeout=30)
        try:
            upstream.request("GET", f"/{path}")
            answer = upstream.getresponse()
            content = answer.read()
        except (OSError, http.client.HTTPException):
            return loopback.Answer(502)  # the viewer has ended
        finally:
            upstream.close()
        if answer.status != 200:
            return loopback.NOT_FOUND
        policy = (
            f"connect-src 'self' data: blob: http://{loopback.LOOPBACK}:{self._grpc_port}; "
            "font-src 'self' data:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; form-action 'none'"
        )
        kind = answer.getheader("Content-Type", "application/octet-stream")
        return loopback.page(content, kind, {"Content-Security-Policy": policy})
